"""Twenty-four laws without a name, for `bench/nameless.py`: none is among those that the proof draws.

Each is a torque at a joint over the coordinates that it says, in units of its own; its numbers are drawn for the motion
at hand. The first twelve act in MuJoCo's arms, step by step; the others on published arms along recorded residuals
(`proof/played`), where the rigid torque of a joint is known as well.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rng = np.random.Generator
State = Mapping[str, Any]
"""q, qd, direction and load of the joint, q_of, qd_of and load_of of another one, time: numbers, or arrays (n,)."""

Q, V, LOAD, TIME = "position", "speed", "load", "time"
Q_OF, V_OF, LOAD_OF = "position of other", "speed of other", "load of other"


@dataclass(frozen=True)
class Nameless:
    """What it is, the coordinates that it hangs on (its direction of motion may multiply it), and how it is drawn:
    from what the motion is (a `State` of arrays) and a generator to its torque at a state."""

    name: str
    over: frozenset[str]
    draw: Callable[[State, Rng], Callable[[State], Any]]


def _law(name: str, *over: str) -> Callable[[Callable[[State, Rng], Callable[[State], Any]]], Nameless]:
    return lambda draw: Nameless(name, frozenset(over), draw)


def _half(x: Any) -> float:
    return 0.5 * float(np.ptp(x))


def _middle(x: Any) -> float:
    return 0.5 * float(np.max(x) + np.min(x))


@_law("bundle that stiffens exponentially", Q)
def _bundle(m: State, rng: Rng) -> Callable[[State], Any]:
    rate = rng.uniform(2.5, 4.0) / _half(m["q"])
    return lambda s: -np.exp(np.minimum(rate * (s["q"] - np.max(m["q"])), 3.0))


@_law("toggle near its dead point", Q)
def _toggle(m: State, rng: Rng) -> Callable[[State], Any]:
    turn, middle = rng.uniform(1.2, 1.4) / _half(m["q"]), _middle(m["q"])
    return lambda s: np.tan(np.clip(turn * (s["q"] - middle), -1.45, 1.45))


@_law("lever over its centre", Q)
def _lever(m: State, rng: Rng) -> Callable[[State], Any]:
    at, wide = np.quantile(m["q"], rng.uniform(0.35, 0.65)), rng.uniform(0.04, 0.1) * _half(m["q"])
    return lambda s: np.tanh((s["q"] - at) / wide)


@_law("latch ball in one notch", Q)
def _notch(m: State, rng: Rng) -> Callable[[State], Any]:
    at, wide = np.quantile(m["q"], rng.uniform(0.3, 0.7)), rng.uniform(0.08, 0.15) * _half(m["q"])
    return lambda s: (s["q"] - at) / wide * np.exp(-(((s["q"] - at) / wide) ** 2))


@_law("seal that lifts above a speed", V)
def _lifts(m: State, rng: Rng) -> Callable[[State], Any]:
    edge = rng.uniform(0.35, 0.55) * np.max(np.abs(m["qd"]))
    return lambda s: s["direction"] * np.maximum(np.abs(s["qd"]) - edge, 0.0)


@_law("bearing that cooks", TIME)
def _cooks(m: State, rng: Rng) -> Callable[[State], Any]:
    whole = np.max(m["time"])
    return lambda s: -s["direction"] * (np.maximum(s["time"], 0.0) / whole) ** 2


@_law("worn strip under a seal", Q, V)
def _strip(m: State, rng: Rng) -> Callable[[State], Any]:
    at, wide = np.quantile(m["q"], rng.uniform(0.3, 0.7)), rng.uniform(0.25, 0.4) * _half(m["q"])
    return lambda s: -s["qd"] * np.exp(-(((s["q"] - at) / wide) ** 2))


@_law("hose over two joints, wound", Q, Q_OF)
def _wound(m: State, rng: Rng) -> Callable[[State], Any]:
    waves, at = rng.uniform(2.0, 3.0) / _half(m["q_of"]), _middle(m["q"])
    return lambda s: -np.cos(waves * s["q_of"]) * (s["q"] - at)


@_law("friction that another joint's angle changes", Q_OF)
def _squeezed(m: State, rng: Rng) -> Callable[[State], Any]:
    waves, phase = rng.uniform(2.5, 3.5) / _half(m["q_of"]), rng.uniform(0, 2 * np.pi)
    return lambda s: -s["direction"] * np.sin(waves * s["q_of"] + phase)


@_law("drag of a cable that another joint pulls", V_OF)
def _pulled(m: State, rng: Rng) -> Callable[[State], Any]:
    slow = rng.uniform(0.1, 0.3) * np.max(np.abs(m["qd_of"]))
    return lambda s: np.tanh(s["qd_of"] / slow)


@_law("counterweight on a lever of two joints", Q, Q_OF)
def _counterweight(m: State, rng: Rng) -> Callable[[State], Any]:
    turn, phase = rng.uniform(2.0, 3.0) / (_half(m["q"]) + _half(m["q_of"])), rng.uniform(0, 2 * np.pi)
    return lambda s: np.sin(2 * turn * (s["q"] + s["q_of"]) + phase)


@_law("clamp that creeps along the travel", TIME, Q)
def _creeps(m: State, rng: Rng) -> Callable[[State], Any]:
    slow, middle = rng.uniform(4.0, 7.0), _middle(m["q"])
    return lambda s: -np.exp(-np.maximum(s["time"], 0.0) / slow) * (s["q"] - middle) ** 3


@_law("gear that bends by its load", LOAD)
def _bends(m: State, rng: Rng) -> Callable[[State], Any]:
    size = np.std(m["load"])
    return lambda s: (s["load"] / size) ** 3


@_law("clutch that slips", LOAD)
def _clutch(m: State, rng: Rng) -> Callable[[State], Any]:
    middle, wide = np.quantile(m["load"], rng.uniform(0.35, 0.65)), rng.uniform(0.15, 0.3) * np.std(m["load"])
    return lambda s: np.tanh((s["load"] - middle) / wide)


@_law("worn teeth under load", LOAD, Q)
def _worn(m: State, rng: Rng) -> Callable[[State], Any]:
    waves, size = rng.uniform(3.0, 5.0) / _half(m["q"]), np.std(m["load"])
    return lambda s: np.sin(waves * s["q"]) * s["load"] / size


@_law("bearing squeezed over a stretch", LOAD, Q)
def _squeeze(m: State, rng: Rng) -> Callable[[State], Any]:
    at, wide = np.quantile(m["q"], rng.uniform(0.3, 0.7)), rng.uniform(0.25, 0.4) * _half(m["q"])
    return lambda s: s["direction"] * np.abs(s["load"]) * np.exp(-(((s["q"] - at) / wide) ** 2))


@_law("wave that grows with speed", Q, V)
def _grows(m: State, rng: Rng) -> Callable[[State], Any]:
    waves = rng.uniform(3.0, 6.0) / _half(m["q"])
    return lambda s: np.sin(waves * s["q"]) * np.abs(s["qd"])


@_law("grease that thins by a power of time", TIME)
def _thins(m: State, rng: Rng) -> Callable[[State], Any]:
    slow, power = rng.uniform(1.0, 3.0), rng.uniform(0.6, 1.0)
    return lambda s: s["direction"] / (1 + s["time"] / slow) ** power


@_law("valve that shuts beyond a place", Q, V)
def _valve(m: State, rng: Rng) -> Callable[[State], Any]:
    at, wide = np.quantile(m["q"], rng.uniform(0.4, 0.6)), 0.05 * _half(m["q"])
    return lambda s: s["qd"] * np.abs(s["qd"]) * (1 + np.tanh((s["q"] - at) / wide))


@_law("belt that another joint's speed lifts", Q, V_OF)
def _lifted(m: State, rng: Rng) -> Callable[[State], Any]:
    middle = _middle(m["q"])
    return lambda s: (s["q"] - middle) * np.abs(s["qd_of"])


@_law("pinion that another joint's load tilts", LOAD_OF)
def _tilts(m: State, rng: Rng) -> Callable[[State], Any]:
    middle, wide = np.mean(m["load_of"]), rng.uniform(0.2, 0.4) * np.std(m["load_of"])
    return lambda s: np.tanh((s["load_of"] - middle) / wide)


@_law("cam on the output", Q)
def _cam(m: State, rng: Rng) -> Callable[[State], Any]:
    waves, phase = rng.uniform(2.0, 3.5) / _half(m["q"]), rng.uniform(0, 2 * np.pi)
    return lambda s: np.maximum(np.sin(waves * s["q"] + phase), 0.0) ** 3


@_law("bevels that press each other", Q, Q_OF)
def _bevels(m: State, rng: Rng) -> Callable[[State], Any]:
    turn, phase = rng.uniform(2.0, 3.0) / (_half(m["q"]) + _half(m["q_of"])), rng.uniform(0, 2 * np.pi)
    return lambda s: np.sin(2 * turn * (s["q"] - s["q_of"]) + phase)


@_law("foam that is crushed", Q, TIME)
def _crushed(m: State, rng: Rng) -> Callable[[State], Any]:
    slow, at = rng.uniform(5.0, 9.0), np.quantile(m["q"], 0.4)
    return lambda s: np.exp(-s["time"] / slow) * np.maximum(s["q"] - at, 0.0) ** 2


STEPPED = (
    _bundle, _toggle, _lever, _notch, _lifts, _cooks, _strip, _wound, _squeezed, _pulled, _counterweight, _creeps,
)  # fmt: skip
"""In MuJoCo."""

PLAYED = (
    _bends, _clutch, _worn, _squeeze, _grows, _thins, _valve, _lifted, _tilts, _cam, _bevels, _crushed,
)  # fmt: skip
"""On published arms, beside recorded residuals."""
