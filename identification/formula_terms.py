"""The dictionary that formulas for empirical laws are made of: terms over a table's coordinates, with their shapes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models.table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Term:
    """A term of the dictionary: its kind, the coordinate it runs over by number (both: -1), and its shape, if any."""

    kind: str
    of: int
    shape: float = 0.0

    @property
    def shaped(self) -> bool:
        """Has it a shape, which it is not linear in?"""
        return self.kind in ("wave", "difference", "above", "below", "decay")

    @property
    def key(self) -> tuple[str, int]:
        """The term without its shape."""
        return self.kind, self.of

    def columns(self, x: Sequence[Array]) -> Array:
        """What its coefficients multiply (n, k)."""
        u = x[0] * x[1] if self.kind == "product" else x[0] + x[1] if self.of == -1 else x[max(self.of, 0)]
        if self.kind == "difference":
            u = x[0] - x[1]
        made: dict[str, Callable[[], list[Array]]] = {
            "constant": lambda: [np.ones_like(u)],
            "product": lambda: [u],
            "size": lambda: [np.abs(u)],
            "sign": lambda: [np.sign(u)],
            "above": lambda: [np.maximum(u - self.shape, 0)],
            "below": lambda: [np.maximum(self.shape - u, 0)],
            "decay": lambda: [np.exp(-u / self.shape)],
        }
        if self.kind in ("wave", "difference"):
            phase = 2 * np.pi * u / self.shape
            return np.stack([np.cos(phase), np.sin(phase)], 1)
        if self.kind.startswith("power"):
            return u[:, None] ** int(self.kind[-1])
        return np.stack(made[self.kind](), 1)

    def words(self, names: Sequence[str], values: Array) -> str:
        """The term in symbols."""
        u = f"({names[0]} + {names[1]})" if self.of == -1 and self.kind == "wave" else names[max(self.of, 0)]
        if self.kind == "difference":
            u = f"({names[0]} - {names[1]})"
        a = f"{values[0]:.4g}"
        if self.kind in ("wave", "difference"):
            turn = f"2*pi*{u}/{self.shape:.4g}"
            return f"{a} * cos({turn}) + {values[1]:.4g} * sin({turn})"
        return {
            "constant": a,
            "product": f"{a} * {names[0]} * {names[-1]}",
            "size": f"{a} * |{u}|",
            "sign": f"{a} * sgn({u})",
            "above": f"{a} * max({u} - {self.shape:.4g}, 0)",
            "below": f"{a} * max({self.shape:.4g} - {u}, 0)",
            "decay": f"{a} * exp(-{u}/{self.shape:.4g})",
        }.get(self.kind, f"{a} * {u}" + (f"^{self.kind[-1]}" if self.kind[-1] > "1" else ""))


def dictionary(table: Table) -> Iterator[Term]:
    """Terms over a table's coordinates. Shapes lie on a grid of starts, which a fit leaves (`formula_search`)."""
    yield Term("constant", 0)
    for i, (name, knots) in enumerate(zip(table.over, table.knots, strict=True)):
        low, span, n = knots[0], knots[-1] - knots[0], len(knots)
        yield from (Term(kind, i) for kind in ("power1", "power2", "power3", "power4", "power5"))
        if low < 0 < knots[-1]:
            yield from (Term("size", i), Term("sign", i))
        yield from (Term("wave", i, span / w) for w in np.arange(0.25, (n - 1) / 3, 0.05))
        yield from (Term(kind, i, low + span * w) for kind in ("above", "below") for w in np.arange(0.05, 1, 0.05))
        if name == "time":
            yield from (Term("decay", i, span * w) for w in np.geomspace(0.03, 3, 25))
    if len(table.over) == 2:
        yield Term("product", -1)
        span = sum(k[-1] - k[0] for k in table.knots)
        for w in np.arange(0.5, sum(table.shape) / 6, 0.05):
            yield from (Term("wave", -1, span / w), Term("difference", -2, span / w))


def identities(keys: frozenset[tuple[str, int]]) -> frozenset[tuple[str, int]]:
    """Keys, and those of single terms that are sums of them at some shape: the same law, written otherwise.

    max(u - c, 0) = u - c + max(c - u, 0); and of u, |u|, max(u, 0) and max(-u, 0) any two add up to the others.
    """
    found = set(keys)
    for i in {of for _, of in keys}:
        bent, same = {("above", i), ("below", i)}, {("power1", i), ("size", i), ("above", i), ("below", i)}
        if {("power1", i), ("constant", 0)} <= keys and bent & keys:
            found |= bent
        if len(same & keys) > 1:
            found |= same
    return frozenset(found)
