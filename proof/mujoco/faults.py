"""Recordings at fault: what a file holds that no arm did."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Rng = np.random.Generator
Columns = Mapping[str, NDArray]


def _with(c: Columns, **changed: NDArray) -> dict[str, NDArray]:
    return {name: changed.get(name, column) for name, column in c.items()}


def _turned(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """A joint that counts angle and torque the other way round than the URDF's axis."""
    return _with(c, **{f"{x}.joint{k + 1}": -c[f"{x}.joint{k + 1}"] for x in ("q", "tau")})


def _millimetres(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """One torque in N·mm."""
    return _with(c, **{f"tau.joint{k + 1}": 1e3 * c[f"tau.joint{k + 1}"]})


def _one_in_degrees(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """One angle in degrees, the others in radians."""
    return _with(c, **{f"q.joint{k + 1}": np.rad2deg(c[f"q.joint{k + 1}"])})


def _saturated(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """A torque sensor whose range ends early."""
    own = f"tau.joint{k + 1}"
    most = rng.uniform(0.35, 0.6) * np.max(np.abs(c[own]))
    return _with(c, **{own: np.clip(c[own], -most, most)})


def _shuffled(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """All channels of two joints exchanged."""
    one, other = f"joint{k + 1}", f"joint{k}"
    return _with(c, **{f"{x}.{a}": c[f"{x}.{b}"] for x in ("q", "tau") for a, b in ((one, other), (other, one))})


def _slipped(c: Columns, k: int, rng: Rng) -> dict[str, NDArray]:
    """An encoder's coupling that slips on its shaft, once."""
    own, time = f"q.joint{k + 1}", c["time"]
    return _with(c, **{own: c[own] - (time > time[-1] * rng.uniform(0.3, 0.7)) * rng.uniform(0.1, 0.4)})


FAULTS: dict[str, Callable[[Columns, int, Rng], dict[str, NDArray]]] = {
    "a joint counts the other way": _turned,
    "one torque in N·mm": _millimetres,
    "one angle in degrees": _one_in_degrees,
    "a torque sensor saturates": _saturated,
    "two joints exchanged": _shuffled,
    "an encoder slips on its shaft": _slipped,
}
"""From columns, a joint's number above 0 and random numbers; each recording of a case gets the same ones."""
