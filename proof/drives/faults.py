"""Recordings at fault, as a workshop makes them: wrong wiring, a wrong zero, lost counts, a sensor at its end."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from .robots import Rng

Columns = Mapping[str, NDArray]


def _with(c: Columns, **changed: NDArray) -> dict[str, NDArray]:
    return {name: changed.get(name, column) for name, column in c.items()}


def _other_zero(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """An encoder that was mounted anew, and never set to zero."""
    own = f"q.joint{k + 1}"
    return _with(c, **{own: c[own] + rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 0.8)})


def _lost_counts(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """An encoder that lost counts at one moment."""
    own, time = f"q.joint{k + 1}", c["time"]
    late = time > time[-1] * rng.uniform(0.3, 0.7)
    return _with(c, **{own: c[own] + late * rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.3)})


def _exchanged(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """Two encoder cables exchanged."""
    one, other = f"joint{k + 1}", f"joint{k if k else 2}"
    pairs = {
        f"{x}.{a}": c[f"{x}.{b}"] for x in ("q", "qd") if f"{x}.{one}" in c for a, b in ((one, other), (other, one))
    }
    return _with(c, **pairs)


def _clipped(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """A torque sensor, or its logger, that ends at half of what the joint needs."""
    own = f"tau.joint{k + 1}"
    most = rng.uniform(0.4, 0.6) * np.max(np.abs(c[own]))
    return _with(c, **{own: np.clip(c[own], -most, most)})


def _motor_side(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """Torque before the gear, of 1:50 to 1:160."""
    own = f"tau.joint{k + 1}"
    return _with(c, **{own: c[own] / rng.integers(50, 161)})


def _microseconds(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """Microseconds, written as seconds."""
    return _with(c, time=1e6 * c["time"])


FAULTS: dict[str, Callable[[Columns, int, Rng], dict[str, NDArray]]] = {
    "an encoder's zero is elsewhere": _other_zero,
    "an encoder lost counts": _lost_counts,
    "two encoders exchanged": _exchanged,
    "a torque is cut off": _clipped,
    "a torque of the motor's side": _motor_side,
    "time in microseconds": _microseconds,
}
"""From columns, a joint's number and random numbers; each recording of a case gets the same random numbers."""
