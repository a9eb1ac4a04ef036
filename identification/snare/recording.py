"""A capture test as means over 50 ms, which a simulation can be compared with.

Letters: K times 50 ms apart from the start; a `Track` is what is seen at them. Positions are means over 50 ms about
each time, forces means over the 50 ms before it: how cables chatter on the pin depends on every detail, their mean
force does not. Forces are tared: their mean over the first half second, with the snare open, is subtracted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.model import Model
from ...models.snare.ring_drive import RingDrive
from ...models.snare.setup import CaptureSetup, SnareTree
from ...recordings import read_recording
from ...recordings.attitude import attitude
from ...recordings.signals import QUATERNION

Array = NDArray[np.float64]

EVERY = 0.05
"""[s] Between the times of a track."""
BEFORE = 0.5
"""[s] At the start, over which the pose is averaged and forces are tared."""
MOVES = 5.0
"""A start velocity below so many standard deviations is taken as none."""
SHORTEST = 2.0
"""[s] Least length of a recording."""
FEWEST = 8
"""Least samples at the start: twice what a cubic takes."""
STILL = 0.02
"""[rad] A target without inertia that turns by more is worth a note."""
OPPOSITE = 0.5
"""Likeness (cosine) with the force on the other body from which on a sensor is taken to read that."""
ON_TARGET = ("target", "pin")
"""Force sensors that carry the target; every other one carries the end effector, whose root it stands at."""


@dataclass(frozen=True)
class Track:
    """The compared signals of a capture: position (K, 3) [m], quaternion (K, 4) w first, force (K, 3) [N] by body.

    ``force`` has ``target`` and ``effector``; of a recording only what was measured, not a number where it has a gap.
    """

    position: Array
    quaternion: Array
    force: Mapping[str, Array]


@dataclass(frozen=True)
class CaptureRecording:
    """One capture test: its file, times (K,) [s] from the start, what was measured, and the set-up at its start.

    ``start`` says how well its start is known; ``sensors`` names the sensor of each body in the track's forces;
    ``zero`` is the time of the recording's first row, ``noise`` the standard deviation of a channel's mean over 50 ms,
    by ``position`` and by body, ``carried`` the RMS of a body's force [N].
    """

    path: str
    body: str
    times: Array
    measured: Track
    sensors: Mapping[str, str]
    setup: CaptureSetup
    start: "Start"
    drive: RingDrive | None
    zero: float
    noise: Mapping[str, float]
    carried: Mapping[str, float]
    notes: tuple[str, ...]


def load_captures(model: Model, paths: Sequence[str | Path]) -> list[CaptureRecording]:
    """Read recordings of captures; raises InputError for what is missing or cannot be."""
    return [_capture(model, path, read_recording(path, model.signals)) for path in paths]


def _capture(model: Model, path: str | Path, data: xr.Dataset) -> CaptureRecording:
    given = model.tree_as(SnareTree).setup
    body = body_of(path, data)
    time = data["time"].values
    zero, span = float(time[0]), float(time[-1] - time[0])
    if span < SHORTEST - 1e-6:  # sums of time steps fall short of it by rounding
        raise InputError(f"{path}: it lasts {span:.3g} s; give {SHORTEST:g} s of a capture or more")
    if np.median(np.diff(time)) > EVERY * (1 + 1e-6):
        raise InputError(f"{path}: a sample every {np.median(np.diff(time)):.3g} s; give {1 / EVERY:g} Hz or more")
    times = np.asarray(EVERY * np.arange(int(span / EVERY + 1e-6) + 1), float)
    since = time - zero
    start = since <= BEFORE
    notes = [*data.attrs["notes"]]
    place = _columns(data, f"pos.{body}", "xyz")
    assert place is not None  # `body_of` saw to it
    if all(f"quat.{body}.{axis}" in data for axis in QUATERNION):
        turn = attitude(data, body, path)
    else:
        turn = np.tile(given.target.orientation, (len(time), 1))
        notes.append(f"quat.{body} is not recorded; its orientation is the model's")
    if not np.any(np.isfinite(turn).all(1) & start):
        raise InputError(
            f"{path}: quat.{body} has no sample in the first {BEFORE:g} s; give its start, or leave it out"
        )
    begun = _start(since[start], place[start])
    if not np.all(np.isfinite(begun.position)):
        raise InputError(f"{path}: pos.{body} has no sample in the first {BEFORE:g} s; give its start")
    orientation = _mean_turn(turn[start])
    target = replace(given.target, position=begun.position, velocity=begun.velocity, orientation=orientation)
    if not target.rotates and (largest := _turned(turn, orientation)) > STILL:
        notes.append(
            f"the target turned by {np.degrees(largest):.2g} deg, which the model leaves out: give [capture] inertia"
        )
    drive = _drive(path, data, since)
    if drive is None:
        notes.append("angle.ring is not recorded; the ring turns as the model has it, from the first row on")
    forces, sensors = _forces(data, since, times, notes)
    measured = Track(_about(since, place, times), _turns(since, turn, times), forces)
    open_snare = int(BEFORE / EVERY)
    noise = {of: _scatter(force[1:open_snare]) for of, force in forces.items()}
    noise["position"] = _scatter(np.diff(measured.position[:open_snare], axis=0)) / np.sqrt(2)
    setup = replace(given, target=target)
    carried = {of: _scatter(force) for of, force in forces.items()}
    known = str(path), body, times, measured, sensors, setup, begun, drive, zero, noise, carried
    return CaptureRecording(*known, tuple(notes))


def _drive(path: str | Path, data: xr.Dataset, since: Array) -> RingDrive | None:
    """The ring's angle as recorded; None where it is not."""
    if "angle.ring" not in data:
        return None
    try:
        return RingDrive.of_samples(since, data["angle.ring"].values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _forces(data: xr.Dataset, since: Array, times: Array, notes: list[str]) -> tuple[dict[str, Array], dict[str, str]]:
    """Tared forces (K, 3) [N] and their sensors, by body; sensors that are not used go into the notes."""
    forces, sensors = {}, {}
    for name in sorted({str(v).split(".")[1] for v in data if str(v).startswith("force.")}):
        values = _columns(data, f"force.{name}", "xyz")
        of = "target" if name in ON_TARGET else "effector"
        if values is None or of in sensors:
            notes.append(f"force.{name} is not used: " + ("not all of x, y, z" if values is None else "one is enough"))
            continue
        tared = values - np.nanmean(values[since <= BEFORE], axis=0)
        forces[of], sensors[of] = _means(since, tared, times), name
    return forces, sensors


def sensed_by(capture: CaptureRecording, track: Track | None) -> CaptureRecording:
    """The capture with its force sensor on the body whose force it shows in a simulation, with a note where it moved.

    The cables' force on the end effector is opposite to that on the target: a name can be wrong, the sign cannot."""
    if track is None or len(capture.sensors) != 1:
        return capture
    ((body, sensor),) = capture.sensors.items()
    other = "target" if body == "effector" else "effector"
    measured = capture.measured.force[body]
    alike = float(np.nansum(measured * track.force[other])), float(np.nansum(measured * track.force[body]))
    size = float(np.sqrt(np.nansum(measured**2) * np.sum(track.force[other] ** 2)))
    if size == 0 or alike[0] < max(OPPOSITE * size, alike[1]):
        return capture
    note = f"force.{sensor} reads the force on the {other}, by its sign"
    return replace(
        capture,
        measured=replace(capture.measured, force={other: measured}),
        sensors={other: sensor},
        noise={**capture.noise, other: capture.noise[body]},
        carried={other: capture.carried[body]},
        notes=(*capture.notes, note),
    )


def check_sensors(captures: Sequence[CaptureRecording]) -> None:
    """Raise InputError where captures do not have force sensors on the same bodies."""
    for capture in captures:
        if capture.sensors.keys() != captures[0].sensors.keys():
            raise InputError(f"{capture.path}: its force sensors are not those of {captures[0].path}; give the same")


def body_of(path: str | Path, data: xr.Dataset) -> str:
    """The one body whose position is recorded; ``target`` where there are several."""
    bodies = sorted({str(v).split(".")[1] for v in data if str(v).startswith("pos.")})
    whole = [b for b in bodies if _columns(data, f"pos.{b}", "xyz") is not None]
    if "target" in whole or len(whole) == 1:
        return "target" if "target" in whole else whole[0]
    raise InputError(f"{path}: pos.target.x, .y and .z are missing; give the captured target's position")


def _columns(data: xr.Dataset, name: str, axes: str) -> Array | None:
    names = [f"{name}.{a}" for a in axes]
    return np.stack([data[n].values for n in names], axis=1) if all(n in data for n in names) else None


class Start(NamedTuple):
    """Where a target starts, (3,) each: position [m] and velocity [m/s] of the fit, the velocity's standard deviation
    ``spread`` [m/s], and the ``lever`` [s]: of a start that is faster by dv, the position is less by lever * dv.
    """

    position: Array
    velocity: Array
    spread: Array
    lever: float

    def shifted(self, setup: CaptureSetup, deviations: Sequence[float]) -> CaptureSetup:
        """The set-up with a start velocity that is off by so many deviations along each axis."""
        faster = self.spread * np.asarray(deviations)
        moved = replace(setup.target, position=self.position - self.lever * faster, velocity=self.velocity + faster)
        return replace(setup, target=moved)


def _start(since: Array, place: Array) -> Start:
    """Where a target starts; not numbers where too few samples are known.

    By a straight line through the first half second; by a cubic where the motion is bent beyond its noise; by the mean
    where it does not move beyond its noise.
    """
    known = np.isfinite(place).all(1)
    if known.sum() < FEWEST:
        return Start(np.full(3, np.nan), np.zeros(3), np.zeros(3), 0.0)
    fits = []
    for degree in (1, 3):
        columns = np.asarray(np.vander(since[known], degree + 1, increasing=True), float)
        found = np.linalg.lstsq(columns, place[known], rcond=None)[0]
        left = np.sum((place[known] - columns @ found) ** 2, axis=0) / (known.sum() - degree - 1)
        fits.append((left, found, np.linalg.inv(columns.T @ columns)))
    left, found, own = fits[1] if fits[0][0].sum() > 1.2 * fits[1][0].sum() else fits[0]
    spread, lever = np.sqrt(left * own[1, 1]), float(-own[0, 1] / own[1, 1])
    if np.linalg.norm(found[1]) < MOVES * (np.linalg.norm(spread) + 1e-6):
        return Start(np.nanmean(place, axis=0), np.zeros(3), spread, lever)
    return Start(found[0], found[1], spread, lever)


def _mean_turn(turns: Array) -> tuple[float, ...]:
    known = turns[np.isfinite(turns).all(1)]
    mean = Rotation.from_quat(known, scalar_first=True).mean()
    return tuple(mean.as_quat(canonical=True, scalar_first=True).tolist())


def _turned(turns: Array, start: Sequence[float]) -> float:
    """Largest angle from the start [rad]; single samples are left out."""
    known = Rotation.from_quat(turns[np.isfinite(turns).all(1)], scalar_first=True)
    return float(np.quantile((known * Rotation.from_quat(start, scalar_first=True).inv()).magnitude(), 0.98))


def _means(since: Array, values: Array, times: Array) -> Array:
    """Mean over the 50 ms before each time (K, c); not a number where there is no sample."""
    number = np.clip(np.ceil(since / EVERY - 1e-9), 0, len(times)).astype(int)
    result = np.full((len(times) + 1, values.shape[1]), np.nan)
    for c in range(values.shape[1]):
        known = np.isfinite(values[:, c])
        count = np.bincount(number[known], minlength=len(times) + 1)
        total = np.bincount(number[known], values[known, c], len(times) + 1)
        result[:, c] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return result[:-1]


def _about(since: Array, values: Array, times: Array) -> Array:
    """Mean over 50 ms about each time (K, c)."""
    return _means(since - EVERY / 2, values, times)


def _turns(since: Array, turns: Array, times: Array) -> Array:
    """Quaternions (K, 4), means over 50 ms about each time; signs are brought together first."""
    known = np.isfinite(turns).all(1)
    signs = np.ones(len(turns))
    signs[known] = np.cumprod(np.where(np.sum(turns[known] * np.roll(turns[known], 1, 0), 1) < 0, -1.0, 1.0))
    mean = _about(since, turns * signs[:, None], times)
    return mean / np.linalg.norm(mean, axis=1, keepdims=True)


def _scatter(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values)))) if np.isfinite(values).any() else 0.0
