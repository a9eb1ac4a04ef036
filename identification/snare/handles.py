"""The parameters of a capture as a search turns them: each by a handle, which has bounds and a step for differences."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log10
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ...models.snare.setup import APPLIED, NUMBERS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Handle:
    """One parameter: its value is ``10^x`` (log), ``x²`` (root) or ``x`` (plain).

    Bounds ``low`` and ``high``, and the ``step`` of differences, are in x; ``tries`` are the values, in the parameter's
    own unit, at which a candidate is tried.
    """

    scale: Literal["log", "root", "plain"]
    low: float
    high: float
    step: float
    tries: tuple[float, ...]

    def x(self, value: float) -> float:
        """Where the handle stands at a value."""
        if self.scale == "log":
            return log10(max(value, 10**self.low))
        return max(value, 0.0) ** 0.5 if self.scale == "root" else value

    def value(self, x: float) -> float:
        """The value there."""
        return 10**x if self.scale == "log" else x * x if self.scale == "root" else x

    def slope(self, x: float) -> float:
        """Size of the value's derivative there, over one step."""
        return abs(self.value(x + self.step) - self.value(x)) / self.step


# Steps are so wide that what they change stands out of the cables' chatter.
HANDLES = {
    "contact_friction": Handle("plain", 0.0, 1.5, 0.03, (0.08, 0.25)),
    "contact_damping": Handle("log", 0.0, 5.0, 0.3, (200.0, 2e3)),
    "contact_stiffness": Handle("log", 5.0, 10.0, 0.25, (1e7, 2e6, 3e5)),
    "cable_damping": Handle("log", -4.5, -0.5, 0.2, (2e-4, 1e-2)),
    "cable_pretension": Handle("plain", 0.0, 5000.0, 60.0, (200.0, 800.0)),
    "umbilical_stiffness": Handle("root", 0.0, 100.0, 1.0, (20.0, 100.0, 500.0)),
    "hang_point_clearance": Handle("plain", 0.0, 0.1, 4e-4, (2e-3, 8e-3)),
    "ring_radius": Handle("plain", 0.08, 0.25, 3e-4, (0.1245, 0.130)),
    "pin_radius": Handle("plain", 3e-3, 0.02, 2e-4, (6e-3, 9.5e-3)),
    "mass": Handle("log", 0.0, 4.0, 0.04, (15.0, 40.0)),
}
"""By the effect's name; each has one parameter."""


def handle_of(placed: PlacedEffect) -> Handle:
    """The handle of an effect's parameter."""
    return HANDLES[placed.effect.name]


def key_of(placed: PlacedEffect) -> str:
    """``effect.place.parameter`` of an effect, which has one."""
    return f"{placed.key}.{(APPLIED | NUMBERS)[placed.effect.name].parameter}"


def values_of(placed: Sequence[PlacedEffect], x: Array) -> dict[str, float]:
    """Parameters by ``effect.place.parameter``, their handles at x (P,)."""
    return {key_of(p): handle_of(p).value(float(v)) for p, v in zip(placed, x, strict=True)}


def bounds(placed: Sequence[PlacedEffect]) -> tuple[Array, Array]:
    """Lowest and highest x (P,), those of held parameters too."""
    handles = [handle_of(p) for p in placed]
    return np.array([h.low for h in handles], float), np.array([h.high for h in handles], float)


def steps(placed: Sequence[PlacedEffect]) -> Array:
    """Steps of differences in x (P,)."""
    return np.array([handle_of(p).step for p in placed], float)


def free(placed: Sequence[PlacedEffect]) -> NDArray[np.bool_]:
    """Which parameters are fitted (P,): those that the model file does not hold."""
    return np.array([not p.hold for p in placed], bool)
