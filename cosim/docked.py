"""A run of the whole end effector: frames, forces, and whether it latched by the limits that count."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..models.docking.closed_forms import seated_share
from ..models.docking.parameters import PRELOAD_WINDOW, RESIDUAL, RESIDUAL_ANGLE, DockingParameters
from ..models.inertia import Array
from .orbit_capture import OrbitCapture, column, columns, frames_of
from .whole_capture import WholeRun

CABLE_STRENGTH = 8000.0
"""Of a cable [N]: the limit of the tolerance study."""
LEAST_SHARE = 0.5
"""Of a ball's third of the preload that counts as seated."""


@dataclass(frozen=True)
class DockingRun:
    """A whole run, n times.

    Parameters
    ----------
    whole : WholeRun
    capture : OrbitCapture
        Its frames; ``tip`` is the carriage's, on which the rings are, ``pin`` the pin's foot.
    travel, motor, tension : array (n,)
        Of the carriage [m], its motor's force [N], and the largest force of a cable on its ring [N].
    off : array (n, 3, 2)
        Of each ball from its seat, axial and lateral [m].
    normal : array (n, 6)
        Of the flanks [N].
    wrist : array (n, 3)
        Force on the end effector, docking and cables, in its axes [N].
    seat : array (n, 6, 3)
        The end effector's frame.
    """

    whole: WholeRun
    capture: OrbitCapture
    travel: Array
    motor: Array
    tension: Array
    off: Array
    normal: Array
    wrist: Array
    seat: Array

    @property
    def times(self) -> Array:
        """[s]"""
        return self.capture.times

    def rows_in(self, *states: str) -> NDArray[np.bool_]:
        """Which rows are in these states of the program (n,)."""
        numbers = column(self.whole.run.recording, "program.state")
        return np.isin(numbers, [self.whole.states.index(state) for state in states])


def docked_of(whole: WholeRun) -> DockingRun:
    """Read a run's recording."""
    table = whole.run.recording
    touching = np.flatnonzero(column(table, "snare.touching") > 0)
    times = table["time"].to_numpy()
    names = [str(key).partition(" ")[0] for key in table.variables]
    joints = [name.removeprefix("q.") for name in names if name.startswith("q.")]
    capture = OrbitCapture(
        times, frames_of(table, "carriage"), frames_of(table, "pin"), frames_of(table, "base"),
        np.column_stack([column(table, f"q.{joint}") for joint in joints]),
        np.column_stack([column(table, f"qd.{joint}") for joint in joints]),
        columns(table, "snare.impulse.effector"), columns(table, "snare.angular_impulse.effector"),
        float(times[touching[0]]) if len(touching) else None,
    )  # fmt: skip
    off = np.column_stack([column(table, f"effector.off.{i}.{way}") for i in (1, 2, 3) for way in ("axial", "lateral")])
    return DockingRun(
        whole, capture, column(table, "effector.travel"), column(table, "effector.force.motor"),
        column(table, "snare.tension"), off.reshape(-1, 3, 2),
        np.column_stack([column(table, f"effector.normal.{i}") for i in range(1, 7)]),
        columns(table, "force.wrist"), frames_of(table, "tip"),
    )  # fmt: skip


def residual(d: DockingRun) -> tuple[float, float]:
    """Remaining misalignment of target and end effector at the end: radial [m], and the angle between them [rad]."""
    seat, pin = d.seat[-1], d.capture.pin[-1]
    relative = seat[3:].T @ (pin[0] - seat[0])
    turn = Rotation.from_matrix(seat[3:].T @ pin[3:]).magnitude()
    return float(np.hypot(relative[1], relative[2])), float(turn)


def ball_shares(d: DockingRun, p: DockingParameters, preload: float) -> Array:
    """Each ball's normal forces over its two even shares of the preload, at the end (3,)."""
    return d.normal[-1].reshape(3, 2).sum(axis=1) / (2 * seated_share(preload, p.flank))


def is_latched(d: DockingRun, p: DockingParameters) -> tuple[bool, str]:
    """Whether it latched within all limits; if not, the reason: the state in which it ended, or the limit that it
    missed.
    """
    if d.whole.fault:
        return False, f"{d.whole.final}: not computed to the end"
    if d.whole.final != "LATCHED":
        return False, d.whole.final
    force = preload(d)
    radial, angle = residual(d)
    for wrong, why in (
        (ball_shares(d, p, force).min() < LEAST_SHARE, "a ball bears less than half its share"),
        (radial > RESIDUAL or angle > RESIDUAL_ANGLE, "residual"),
        (not PRELOAD_WINDOW[0] <= force <= PRELOAD_WINDOW[1], "preload"),
        (d.tension.max() > CABLE_STRENGTH, "cable"),
    ):
        if wrong:
            return False, why
    return True, "LATCHED"


def margin(d: DockingRun, p: DockingParameters) -> float:
    """Signed distance from failure of `is_latched`, as a share of the nearest limit, in -1 to 1."""
    if d.whole.fault or d.whole.final != "LATCHED":
        return -1.0
    force, (radial, angle) = preload(d), residual(d)
    low, high = PRELOAD_WINDOW
    found = min(
        ball_shares(d, p, force).min() / LEAST_SHARE - 1,
        1 - radial / RESIDUAL,
        1 - angle / RESIDUAL_ANGLE,
        min(force - low, high - force) / (0.5 * (high - low)),
        1 - d.tension.max() / CABLE_STRENGTH,
    )
    return float(np.clip(found, -1.0, 1.0))


def preload(d: DockingRun) -> float:
    """Largest force of the carriage's motor while it preloads and the latches close [N]."""
    rows = d.rows_in("PRELOAD", "LATCH")
    return float(d.motor[rows].max()) if rows.any() else 0.0


def mean_wrist(d: DockingRun, window: float = 0.01) -> tuple[Array, Array]:
    """Middles of windows [s] and the size of the mean force on the end effector in each (k,) [N]."""
    times = d.times
    summed = np.vstack([np.zeros(3), np.cumsum(0.5 * (d.wrist[1:] + d.wrist[:-1]) * np.diff(times)[:, None], axis=0)])
    edges = np.arange(times[0], times[-1], window)
    at = np.column_stack([np.interp(edges, times, x) for x in summed.T])
    return edges[:-1] + window / 2, np.linalg.norm(np.diff(at, axis=0), axis=1) / window


def momentum_drift(d: DockingRun) -> float:
    """Largest change of the total linear momentum over the largest impulse on the carriage."""
    table = d.whole.run.recording
    total = sum(
        columns(table, f"{who}.linear") for who in ("effector.momentum", "effector.momentum.target", "snare.momentum")
    )
    change = np.linalg.norm(np.asarray(total) - np.asarray(total)[0], axis=1).max()
    return float(change / max(np.linalg.norm(d.capture.impulse, axis=1).max(), 1e-300))


def energies(d: DockingRun) -> dict[str, Array]:
    """Energies (n,) since the start [J]: the work of both motors and its parts; ``residual`` is the difference."""
    table = d.whole.run.recording

    def own(name: str) -> Array:
        values = column(table, f"effector.energy.{name}")
        return values - values[0]

    def snare(name: str) -> Array:
        values = column(table, f"snare.energy.{name}")
        return values - values[0]

    ledger = {
        "motors": snare("ring_motor") + own("motor"),
        "cables, strain": snare("strain"),
        "cables' motion and contacts": snare("kinetic") + snare("overlap"),
        "bodies' motion": own("kinetic"),
        "docking's contacts": own("stored"),
        "suspension and weight": own("suspension"),
        "latches": own("latches"),
        "brake and stops": own("brake"),
        "lost in screw and carriage": own("carriage_lost"),
        "lost in cables": snare("damped") + snare("friction"),
        "lost in docking": own("contact_lost"),
        "lost in joints": own("joints"),
    }
    return ledger | {"residual": ledger["motors"] - sum(ledger[name] for name in ledger if name != "motors")}
