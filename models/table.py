"""A table over one or two coordinates of a joint, read as a smooth curve or map: what a law without a name looks like.

Between evenly spaced knots a table is read by cubic convolution (Keys 1981): values at the knots are met, the slope is
continuous, and a value reaches two steps to either side. Beyond the outermost knots it is held at its end value.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 4
"""Knots along a coordinate: as many as one cubic meets."""

MOST = 256
"""Values of one table: a law of more takes longer to compile than it is worth."""

OWN = ("position", "speed", "load", "time", "distance travelled")
"""Coordinates of the joint itself; speed without its sign."""

OTHERS = ("position of ", "speed of ")
"""Coordinates of another joint, by its name; speed with its sign."""

UNITS = {"position": "S", "speed": "S/s", "load": "T", "time": "s", "distance travelled": "S"}
"""Of each coordinate, with S and T for a joint's position and torque."""

TIMES = {
    "": "",
    "direction": " by direction",
    "speed": " by speed",
    "driving": " when driving",
    "braking": " when braking",
}
"""What a table's value is multiplied by, and how that is said: the sign of speed, the speed as a share of the peak
speed, the sign of speed while the motor drives the load or while it holds it back."""


@dataclass(frozen=True)
class Table:
    """Coordinates, what the value is multiplied by, and evenly spaced knots along each coordinate [S, S/s, T, s]."""

    over: tuple[str, ...]
    times: str
    knots: tuple[tuple[float, ...], ...]

    @property
    def words(self) -> str:
        """``position and position of joint2 by direction``."""
        return " and ".join(self.over) + TIMES[self.times]

    @property
    def shape(self) -> tuple[int, ...]:
        """Knots along each coordinate."""
        return tuple(map(len, self.knots))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the values, the last coordinate's knots running fastest."""
        stem = re.sub(r"\W+", "_", self.words)
        return tuple("_".join([stem, *(str(i + 1) for i in at)]) for at in product(*map(range, self.shape)))

    @property
    def others(self) -> tuple[str, ...]:
        """Other joints that it reads."""
        return tuple(c.removeprefix(start) for c in self.over for start in OTHERS if c.startswith(start))

    def weights(self, coordinates: Sequence[Array]) -> Array:
        """What each value counts for (n, values) at samples of the coordinates, each (n,)."""
        parts = [
            np.stack(cardinal(x, k, np.maximum, np.minimum), 1) for x, k in zip(coordinates, self.knots, strict=True)
        ]
        if len(parts) == 1:
            return parts[0]
        return (parts[0][:, :, None] * parts[1][:, None, :]).reshape(len(parts[0]), -1)


def cardinal(
    x: Any, knots: Sequence[float], larger: Callable[[Any, Any], Any], smaller: Callable[[Any, Any], Any]
) -> list[Any]:
    """Weights of the values at the knots for a table read at ``x``, in numbers or symbols; they add up to one.

    One knot beyond each end stands for the cubic through the end's three: v(-1) = 3 v(0) - 3 v(1) + v(2).
    """
    n = len(knots)
    u = larger(smaller((x - knots[0]) / (knots[-1] - knots[0]) * (n - 1), n - 1), 0)

    def kernel(k: int) -> Any:
        # Keys's kernel of the distance s: piecewise cubic, from what is left to one and to two steps.
        s = larger(u - k, k - u)
        a, b = larger(1 - s, 0), larger(2 - s, 0)
        return a * a * (1 - 2 * a) + 0.5 * b * b * (b - 1)

    found = [kernel(k) for k in range(n)]
    for beyond, ends in ((kernel(-1), (0, 1, 2)), (kernel(n), (n - 1, n - 2, n - 3))):
        for k, factor in zip(ends, (3, -3, 1), strict=True):
            found[k] = found[k] + factor * beyond
    return found


def read_words(words: str) -> tuple[tuple[str, ...], str] | None:
    """Coordinates and factor of a curve in words, ``position, fine by direction``; None where no table can be it."""
    plain = re.sub(r", (narrow|fine)\b", "", words)
    times = next((t for t, said in TIMES.items() if said and plain.endswith(said)), "")
    over = tuple(plain.removesuffix(TIMES[times]).split(" and "))
    return (over, times) if len(over) <= 2 and all(map(is_coordinate, over)) else None


def is_coordinate(name: str) -> bool:
    """Is it one that a table may run over?"""
    return name in OWN or name.startswith(OTHERS)
