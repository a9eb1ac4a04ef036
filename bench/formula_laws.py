"""Laws of joints without a name, for `bench/formulas.py`: from texts on hardware, with their terms, if they have any.

Harmonic drives: Tuttle and Seering (1996). Friction over speed, load and warmth: Bittencourt and Gunnarsson (2012),
Waiboer, Aarts and Jonker (2005). Hardening springs: Duffing (1918). Stops: Hertz (1882).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Key = tuple[str, int]


@dataclass(frozen=True)
class Law:
    """What it is, the coordinates and factor of its table, the value (n,) at coordinates, and its terms: kind and
    coordinate with amplitude and shape (0: none); empty where the dictionary does not have it."""

    name: str
    over: tuple[str, ...]
    times: str
    value: Callable[..., Array]
    terms: tuple[tuple[Key, float, float], ...] = ()


def _hinge(x: Array) -> Array:
    return 0.5 * (x + np.abs(x))


def _turn(x: Array, period: float, phase: float) -> Array:
    return np.sin(2 * np.pi * x / period + phase)


Q, V, LOAD, TIME, OTHER = ("position",), ("speed",), ("load",), ("time",), ("position of b",)
TWO = (*Q, *OTHER)

LAWS = (
    Law(
        "harness, linear and cubic",
        Q,
        "",
        lambda q: 0.8 * q + 1.1 * q**3,
        ((("power1", 0), 0.8, 0), (("power3", 0), 1.1, 0)),
    ),
    Law("bundle of the fifth power", Q, "", lambda q: q**5, ((("power5", 0), 1.0, 0),)),
    Law(
        "bundle beside a named spring",
        Q,
        "",
        lambda q: q**5 - 2 * q,
        ((("power1", 0), -2.0, 0), (("power5", 0), 1.0, 0)),
    ),
    Law("balancing spring, out of place", Q, "", lambda q: _turn(q, 2 * np.pi, 0.5), ((("wave", 0), 1.0, 2 * np.pi),)),
    Law("cogging", Q, "", lambda q: _turn(q, 0.31, 1.0), ((("wave", 0), 1.0, 0.31),)),
    Law("friction that ripples", Q, "direction", lambda q: _turn(q, 0.7, 0.4), ((("wave", 0), 1.0, 0.7),)),
    Law(
        "harmonic drive, once and twice",
        Q,
        "",
        lambda q: _turn(q, 0.5, 0.4) + 0.6 * _turn(q, 0.25, 2),
        ((("wave", 0), 1.0, 0.5), (("wave", 0), 0.6, 0.25)),
    ),
    Law("cushion at the upper end", Q, "", lambda q: _hinge(q - 0.6), ((("above", 0), 1.0, 0.6),)),
    Law("cushion at the lower end", Q, "", lambda q: _hinge(-0.5 - q), ((("below", 0), 1.0, -0.5),)),
    Law(
        "cushions at both ends",
        Q,
        "",
        lambda q: _hinge(q - 0.7) - 1.3 * _hinge(-0.6 - q),
        ((("above", 0), 1.0, 0.7), (("below", 0), -1.3, -0.6)),
    ),
    Law("lever over its centre", Q, "", np.sign, ((("sign", 0), 1.0, 0),)),
    Law("harness wound both ways", Q, "", np.abs, ((("size", 0), 1.0, 0),)),
    Law("twisted bundle that shortens", Q, "", lambda q: q**2, ((("power2", 0), 1.0, 0),)),
    Law("grease that warms", TIME, "direction", lambda t: np.exp(-t / 9.0), ((("decay", 0), 1.0, 9.0),)),
    Law("clamp that creeps", TIME, "", lambda t: np.exp(-t / 14.0), ((("decay", 0), 1.0, 14.0),)),
    Law("preload that grows by heat", TIME, "direction", lambda t: t, ((("power1", 0), 1.0, 0),)),
    Law("churning", V, "direction", lambda v: v**2, ((("power2", 0), 1.0, 0),)),
    Law("windage", V, "direction", lambda v: v**3, ((("power3", 0), 1.0, 0),)),
    Law("seal that lifts above a speed", V, "direction", lambda v: -_hinge(v - 0.9), ((("above", 0), -1.0, 0.9),)),
    Law("gear loss by the load's size", LOAD, "direction", np.abs, ((("size", 0), 1.0, 0),)),
    Law("gear that bends by its load", LOAD, "", lambda f: f**3, ((("power3", 0), 1.0, 0),)),
    Law("ripple of the other joint", OTHER, "", lambda y: _turn(y, 0.8, 0.2), ((("wave", 0), 1.0, 0.8),)),
    Law("cable over two joints", TWO, "", lambda x, y: x * y, ((("product", -1), 1.0, 0),)),
    Law("bevels of a wrist, sum", TWO, "", lambda x, y: _turn(x + y, 2.1, 0.3), ((("wave", -1), 1.0, 2.1),)),
    Law(
        "bevels of a wrist, difference", TWO, "", lambda x, y: _turn(x - y, 2.6, 0.9), ((("difference", -2), 1.0, 2.6),)
    ),
    Law(
        "springs of two joints",
        TWO,
        "",
        lambda x, y: x + 0.9 * y**3,
        ((("power1", 0), 1.0, 0), (("power3", 1), 0.9, 0)),
    ),
    # ---- Outside the dictionary --------------------------------------------------------------------------------------
    Law("damaged tooth", Q, "", lambda q: np.exp(-(((q - 0.2) / 0.12) ** 2)) * np.sin(17 * (q - 0.2))),
    Law("seal over one stretch", Q, "direction", lambda q: np.tanh((q + 0.3) / 0.05) - np.tanh((q - 0.2) / 0.05)),
    Law("play with a soft spring", Q, "", lambda q: np.tanh(q / 0.25)),
    Law("Hertz's stop", Q, "", lambda q: _hinge(q - 0.1) ** 1.5),
    Law("toggle near its dead point", Q, "", lambda q: np.tan(0.9 * q)),
    Law("bundle that stiffens exponentially", Q, "", lambda q: np.exp(2.2 * q)),
    Law("Stribeck's bump", V, "direction", lambda v: np.exp(-((v / 0.4) ** 2))),
    Law("grease that thins by a power", TIME, "direction", lambda t: 1 / (1 + t / 5.0) ** 0.7),
    Law("cable around a corner", TWO, "", lambda x, y: np.sin(2 * y) * np.cos(x)),
)
