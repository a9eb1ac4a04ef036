"""Laws without a name, and recordings that are at fault."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from .concealed import MOST, Concealed, TooMuch
from .laws import table, zero_mean
from .machine import Drive, Extra, Machine
from .motions import STEP, Motion
from .residuals import rms
from .robots import Rng


def beside_names(d: Drive, k: int, x: NDArray) -> float:
    """RMS of what the nearest named laws of a joint leave of a torque (n,) there."""
    q, v, load, sign = d.q[:, k], d.qd[:, k], d.load[:, k], d.direction[:, k]
    time = np.arange(len(q)) * STEP
    near = np.stack([np.ones_like(q), time, q, v, d.qdd[:, k], v * np.abs(v), load, sign, np.abs(sign)], axis=1)
    near = np.concatenate([near, (np.abs(load) * sign)[:, None]], axis=1)[::10]
    near = near / (np.sqrt(np.mean(near**2, axis=0)) + 1e-12)
    return rms(x[::10] - near @ np.linalg.lstsq(near, x[::10], rcond=None)[0])


def _other(d: Drive, k: int) -> int:
    return k - 1 if k else 1


def _hose(d: Drive, k: int, rng: Rng) -> Extra:
    o = _other(d, k)
    one, two = (rng.uniform(1.5, 3.0) / np.ptp(d.q[:, j]) * 2.0 for j in (k, o))
    a, b = rng.uniform(0.0, 6.0, 2)
    return lambda e: np.sin(one * e.q[:, k] + a) * np.sin(two * e.q[:, o] + b)


def _stirred(d: Drive, k: int, rng: Rng) -> Extra:
    o = _other(d, k)
    return lambda e: e.qd[:, k] * np.abs(e.qd[:, o])


def _tooth(d: Drive, k: int, rng: Rng) -> Extra:
    q = d.q[:, k]
    at, wide = float(np.quantile(q, rng.uniform(0.3, 0.7))), float(np.ptp(q) * rng.uniform(0.03, 0.08))
    return lambda e: np.exp(-(((e.q[:, k] - at) / wide) ** 2)) * np.sin(5.0 * (e.q[:, k] - at) / wide)


def _seal(d: Drive, k: int, rng: Rng) -> Extra:
    q = d.q[:, k]
    low = float(np.quantile(q, rng.uniform(0.25, 0.5)))
    high = low + float(np.ptp(q) * rng.uniform(0.15, 0.3))
    return lambda e: ((e.q[:, k] > low) & (e.q[:, k] < high)) * np.maximum(e.direction[:, k], 0.0)


def _chatter(d: Drive, k: int, rng: Rng) -> Extra:
    top, hertz = float(np.abs(d.qd[:, k]).max()), float(rng.uniform(3.0, 8.0))
    middle = top * rng.uniform(0.3, 0.6)

    def law(e: Drive) -> NDArray:
        time = np.arange(len(e.q)) * STEP
        return np.exp(-(((np.abs(e.qd[:, k]) - middle) / (0.15 * top)) ** 2)) * np.sin(2.0 * np.pi * hertz * time)

    return law


def _detent(d: Drive, k: int, rng: Rng) -> Extra:
    travel = float(np.ptp(d.q[:, k]))
    period, half, knots = travel / rng.uniform(3.0, 6.0), travel * rng.uniform(0.03, 0.1), zero_mean(rng, 6)

    def law(e: Drive) -> NDArray:
        dragged, now = np.empty(len(e.q)), float(e.q[0, k])
        for i, x in enumerate(e.q[:, k].tolist()):
            now = min(max(now, x - half), x + half)
            dragged[i] = now
        return table(dragged, period, knots)

    return law


Outside = Callable[[Drive, int, Rng], Extra]

OUTSIDE: dict[str, Outside] = {
    "hose over two joints": _hose,
    "grease stirred by another joint": _stirred,
    "damaged tooth": _tooth,
    "seal that rubs one way": _seal,
    "chatter in a range of speeds": _chatter,
    "detent that is dragged along": _detent,
}


def lawless(draw: Outside, machine: Machine, motion: Motion, k: int, wanted: float, rng: Rng) -> Concealed:
    """A law without a name at a joint, of the wanted RMS [N·m] beside the nearest named ones."""
    d = machine.drive(motion)
    unit = draw(d, k, rng)
    column = unit(d)
    size = wanted / max(beside_names(d, k, column), 1e-12)
    raw = size * rms(column)
    if not raw <= MOST * rms(machine.torque(motion)[:, k]):
        raise TooMuch(f"{raw:.3g} N·m")
    return Concealed(machine.with_extra(k, lambda e: size * unit(e)), f"joint{k + 1}", k, raw)


Columns = Mapping[str, NDArray]


def _changed(columns: Columns, **by: NDArray) -> dict[str, NDArray]:
    return {**columns, **by}


def _degrees(c: Columns, k: int) -> dict[str, NDArray]:
    return {name: np.rad2deg(x) if name.startswith(("q.", "qd.")) else x for name, x in c.items()}


def _centimetres(c: Columns, k: int) -> dict[str, NDArray]:
    return {name: 100.0 * x if name.startswith("tau.") else x for name, x in c.items()}


def _milliseconds(c: Columns, k: int) -> dict[str, NDArray]:
    return _changed(c, time=1e3 * c["time"])


def _torque_turned(c: Columns, k: int) -> dict[str, NDArray]:
    return _changed(c, **{f"tau.joint{k + 1}": -c[f"tau.joint{k + 1}"]})


def _encoder_turned(c: Columns, k: int) -> dict[str, NDArray]:
    own = f"joint{k + 1}"
    return _changed(c, **{f"{x}.{own}": -c[f"{x}.{own}"] for x in ("q", "qd") if f"{x}.{own}" in c})


def _swapped(c: Columns, k: int) -> dict[str, NDArray]:
    one, other = f"tau.joint{k + 1}", f"tau.joint{k if k else 2}"
    return _changed(c, **{one: c[other], other: c[one]})


FAULTS: dict[str, Callable[[Columns, int], dict[str, NDArray]]] = {
    "angles in degrees": _degrees,
    "torque in N·cm": _centimetres,
    "time in milliseconds": _milliseconds,
    "one torque with the wrong sign": _torque_turned,
    "one encoder with the wrong sign": _encoder_turned,
    "two torques exchanged": _swapped,
}
