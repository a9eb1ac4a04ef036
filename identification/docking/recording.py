"""A docking test as means over a tenth of a second, which a simulation can be compared with.

The carriage's travel and the latches' closing are inputs of the simulation; every other channel is compared. The end
effector's pose is in the target's frame, and its turn counts from the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.docking.bench import NEVER, SEEN, DockingCommand
from ...models.model import Model
from ...recordings import read_recording
from ...recordings.attitude import attitude
from ...recordings.signals import QUATERNION

Array = NDArray[np.float64]

EVERY, KNOTS = 0.1, 2
"""[s] Windows over which everything is averaged, and into how many stretches of its travel each is cut."""
BEFORE = 0.25
"""[s] At the start, carriage still and nothing touching, over which the pose is averaged."""
SHORTEST = 2.0
"""[s] Least length of a recording."""
FEWEST = 8
"""Least samples in a window: four for each parabola of its travel."""
UNITS = {"pos": "m", "turn": "rad", "force": "N", "torque": "N*m", "tau": "N", "tension": "N"}


@dataclass(frozen=True)
class DockingRecording:
    """One docking test: its file, the ends of the windows (n + 1,) [s], what was measured in them (n, c) by channel,
    and what the test was told to do. ``zero`` is the time of the recording's first row."""

    path: str
    times: Array
    channels: tuple[str, ...]
    measured: Array
    motion: DockingCommand
    zero: float
    notes: tuple[str, ...]

    def of(self, seen: Array) -> Array:
        """A simulation's columns (n, c) in the order of these channels, from `SEEN`'s over each stretch."""
        own = seen[:, [SEEN.index(name) for name in self.channels]]
        return own.reshape(-1, KNOTS, len(self.channels)).mean(axis=1)


def unit_of(channel: str) -> str:
    """Its unit."""
    return UNITS[channel.partition(".")[0]]


def load_records(model: Model, paths: Sequence[str | Path]) -> list[DockingRecording]:
    """Read recordings of docking tests; raises InputError for what is missing, cannot be, or is not alike."""
    records = [_record(model, path, read_recording(path, model.signals, {"carriage": "prismatic"})) for path in paths]
    for record in records[1:]:
        if record.channels != records[0].channels:
            other = sorted(set(record.channels) ^ set(records[0].channels))[0]
            raise InputError(f"{record.path}: {other} is not in all recordings; give the same channels in each")
    return records


def _record(model: Model, path: str | Path, data: xr.Dataset) -> DockingRecording:
    time = data["time"].values
    zero, since = float(time[0]), time - time[0]
    if since[-1] < SHORTEST:
        raise InputError(f"{path}: it lasts {since[-1]:.3g} s; give {SHORTEST:g} s of a docking test or more")
    if np.median(np.diff(time)) > EVERY / FEWEST:
        raise InputError(f"{path}: a sample every {np.median(np.diff(time)):.3g} s; give {FEWEST / EVERY:g} Hz or more")
    for name in ("q.carriage", *(f"pos.effector.{a}" for a in "xyz"), *(f"quat.effector.{a}" for a in QUATERNION)):
        if name not in data:
            raise InputError(f"{path}: {name} is missing; a docking test is told by the carriage's travel and the pose")
    times = np.asarray(EVERY * np.arange(int(since[-1] / EVERY + 1e-6) + 1), float)
    still = since <= BEFORE
    place = np.stack([data[f"pos.effector.{a}"].values for a in "xyz"], axis=1)
    turns = attitude(data, "effector", path)
    known = np.isfinite(turns).all(1)
    if not np.any(known & still) or not np.isfinite(place[still]).any(0).all():
        raise InputError(f"{path}: the pose has no sample in the first {BEFORE:g} s; give its start")
    start = Rotation.from_quat(turns[known & still], scalar_first=True).mean()
    turned = np.full((len(time), 3), np.nan)
    turned[known] = (Rotation.from_quat(turns[known], scalar_first=True) * start.inv()).as_rotvec()
    columns = {f"pos.effector.{a}": place[:, i] for i, a in enumerate("xyz")}
    columns |= {f"turn.effector.{a}": turned[:, i] for i, a in enumerate("xyz")}
    columns |= {name: data[name].values for name in SEEN if name in data}
    channels = tuple(name for name in SEEN if name in columns)
    measured = np.stack([_means(since, columns[name], times) for name in channels], axis=1)
    knots = np.linspace(0.0, times[-1], KNOTS * (len(times) - 1) + 1)
    travel, rate = _followed(path, since, data["q.carriage"].values, knots)
    motion = DockingCommand(
        knots, travel, rate, np.nanmean(place[still], axis=0), start.as_quat(canonical=True, scalar_first=True),
        _latch(path, since, data),
    )  # fmt: skip
    return DockingRecording(str(path), times, channels, measured, motion, zero, tuple(data.attrs["notes"]))


def _means(since: Array, values: Array, times: Array) -> Array:
    """Mean over each window (n,); not a number where there is no sample."""
    number = np.clip(np.ceil((since - times[0]) / EVERY - 1e-9), 0, len(times)).astype(int)
    known = np.isfinite(values)
    count = np.bincount(number[known], minlength=len(times) + 1)[1:-1]
    total = np.bincount(number[known], values[known], len(times) + 1)[1:-1]
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _followed(path: str | Path, since: Array, travel: Array, times: Array) -> tuple[Array, Array]:
    """Travel [m] and rate [m/s] at the stretches' ends: a parabola through the samples half a stretch about."""
    found = np.empty((len(times), 2))
    known = np.isfinite(travel)
    own, values = since[known], travel[known]
    about = EVERY / KNOTS / 2
    edges = np.searchsorted(own, np.stack([times - about, times + about]) + 1e-9)
    for k, (t, a, b) in enumerate(zip(times, *edges, strict=True)):
        if b - a < FEWEST // KNOTS // 2:
            raise InputError(f"{path}: q.carriage has a gap at {t:.3g} s; give its travel without one")
        degree = min(2, b - a - 1)
        powers = np.vander(own[a:b] - t, degree + 1, increasing=True)
        found[k] = np.linalg.lstsq(powers, values[a:b], rcond=None)[0][:2]
    return found[:, 0], found[:, 1]


def _latch(path: str | Path, since: Array, data: xr.Dataset) -> tuple[float, float]:
    """When the latches began to close, and when they were closed [s]."""
    if "closed.latches" not in data:
        return NEVER, NEVER + 1.0
    share = data["closed.latches"].values
    known = np.isfinite(share)
    share, own = share[known], since[known]
    if len(share) and (share.min() < 0 or share.max() > 1 or np.any(np.diff(share) < -1e-6)):
        raise InputError(f"{path}: closed.latches must rise from 0 (open) to 1 (closed) and stay; end before they open")
    if not len(share) or share[-1] == 0:
        return NEVER, NEVER + 1.0
    if share[0] > 0 or share[-1] < 1:
        raise InputError(f"{path}: closed.latches goes from {share[0]:g} to {share[-1]:g}; record all of the closing")
    # The straight line through what lies between: samples miss both ends.
    first, last = int(np.flatnonzero(share == 0)[-1]), int(np.flatnonzero(share == 1)[0])
    if last - first < 2:
        return float(own[first]), float(own[last])
    slope, start = np.polyfit(own[first + 1 : last], share[first + 1 : last], 1) if last - first > 2 else (0.0, 0.0)
    if slope <= 0:
        return float(own[first]), float(own[last])
    return float(-start / slope), float((1 - start) / slope)
