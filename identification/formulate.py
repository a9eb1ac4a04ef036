"""``snarelab formulate``: a formula for an empirical law, by sparse regression over a small dictionary with units.

Terms are added one at a time, the one that takes most of the table's weighted misfit, as long as the Bayesian
information criterion falls (Schwarz 1978; sparse regression: Brunton, Proctor and Kutz 2016). A rival is the formula
with one term exchanged for another of the dictionary that stays within the table's own error.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.empirical import NAME, table_values, tables_of
from ..models.model import Model
from ..models.table import Table
from ..report.words import percent

Array = NDArray[np.float64]

MOST_TERMS = 3
LEAST_ERROR = 0.02
"""Error of a table's values that is taken where none is stored, or less [share of their RMS]."""


@dataclass(frozen=True)
class Term:
    """A term of the dictionary: its kind, the coordinate it runs over by number (both: -1), and its shape, if any."""

    kind: str
    of: int
    shape: float = 0.0

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


@dataclass(frozen=True)
class TableFormula:
    """Terms with their coefficients, the share of the table's energy they explain [0 to 1], and their distance from the
    table in its own standard errors (RMS)."""

    terms: tuple[Term, ...]
    values: tuple[Array, ...]
    share: float
    error: float

    def words(self, table: Table) -> str:
        """The formula in symbols, with the factor."""
        names = [c.replace(" ", "_") for c in table.over]
        text = " + ".join(t.words(names, v) for t, v in zip(self.terms, self.values, strict=True)).replace("+ -", "- ")
        factor = {"": "", "direction": "sgn(qd)", "speed": "qd/peak", "driving": "[driving] sgn(qd)"}
        factor["braking"] = "[braking] sgn(qd)"
        return f"({text}) * {factor[table.times]}" if table.times else text


@dataclass(frozen=True)
class FormulaChoice:
    """A table's best formula and its rivals, which the table cannot tell from it."""

    at: str
    table: Table
    best: TableFormula
    rivals: tuple[TableFormula, ...]

    def to_json(self) -> dict[str, Any]:
        """The published form."""

        def one(f: TableFormula) -> dict[str, Any]:
            return {"formula": f.words(self.table), "share": f.share, "error": f.error}

        return {"at": self.at, "over": self.table.words, **one(self.best), "rivals": [one(r) for r in self.rivals]}

    def __str__(self) -> str:
        """What the command prints."""
        lines = [
            f"{NAME} at {self.at} over {self.table.words}:",
            f"  {self.best.words(self.table)}   {percent(self.best.share, 3)} of it",
        ]
        lines += [f"  or, within its error: {r.words(self.table)}   {percent(r.share, 3)}" for r in self.rivals]
        return "\n".join(lines)


def formulate(model: Model, at: str | None = None) -> list[FormulaChoice]:
    """Formulas for the tables of a model, or for those at one joint.

    Raises
    ------
    InputError
        Where there is no table.
    """
    found = []
    for p in model.effects:
        for t in tables_of(p.effect):
            if at in (None, p.at):
                std = None
                if f"std.{NAME}.{p.at}.{t.names[0]}" in model.values:
                    std = table_values(t, p.at, model.values, "std.")
                found.append(formulate_table(p.at, t, table_values(t, p.at, model.values), std))
    if not found:
        where = f" at {at!r}" if at else ""
        raise InputError(
            f"{model.path}: no [[{NAME}]] table{where}; 'snarelab diagnose --save-model' writes what has no name"
        )
    return found


def formulate_table(at: str, table: Table, values: Array, std: Array | None) -> FormulaChoice:
    """A formula for one table: values and deviations in its shape."""
    grid = np.meshgrid(*(np.array(k) for k in table.knots), indexing="ij")
    x, v = [g.ravel() for g in grid], values.ravel()
    least = LEAST_ERROR * max(float(np.sqrt(np.mean(v**2))), 1e-300)
    error = np.maximum(np.zeros_like(v) if std is None else std.ravel(), least)
    every = list(_dictionary(table))
    best = TableFormula((), (), 0.0, float(np.sqrt(np.mean((v / error) ** 2))))
    for _ in range(MOST_TERMS):
        tried = [_fitted((*best.terms, t), x, v, error) for t in every if t not in best.terms]
        next_one = min(tried, key=lambda f: _criterion(f, len(v)))
        if _criterion(next_one, len(v)) >= _criterion(best, len(v)):
            break
        best = next_one
    if not best.terms:
        best = _fitted((Term("constant", 0),), x, v, error)
    rivals: dict[frozenset[tuple[str, int]], TableFormula] = {}
    own = frozenset((t.kind, t.of) for t in best.terms)
    for k in range(len(best.terms)):
        for t in every:
            other = _fitted((*best.terms[:k], t, *best.terms[k + 1 :]), x, v, error)
            key = frozenset((y.kind, y.of) for y in other.terms)
            if key != own and other.error <= max(1.0, best.error):
                rivals[key] = min(rivals.get(key, other), other, key=lambda f: f.error)
    return FormulaChoice(at, table, best, tuple(sorted(rivals.values(), key=lambda f: f.error)[:5]))


def _dictionary(table: Table) -> Iterator[Term]:
    yield Term("constant", 0)
    for i, (name, knots) in enumerate(zip(table.over, table.knots, strict=True)):
        low, span, n = knots[0], knots[-1] - knots[0], len(knots)
        yield from (Term(kind, i) for kind in ("power1", "power2", "power3"))
        if low < 0 < knots[-1]:
            yield from (Term("size", i), Term("sign", i))
        yield from (Term("wave", i, span / w) for w in np.arange(0.5, (n - 1) / 3, 0.05))
        yield from (Term(kind, i, low + span * w) for kind in ("above", "below") for w in np.arange(0.05, 1, 0.05))
        if name == "time":
            yield from (Term("decay", i, span * w) for w in np.geomspace(0.03, 3, 25))
    if len(table.over) == 2:
        yield Term("product", -1)
        span = sum(k[-1] - k[0] for k in table.knots)
        for w in np.arange(0.5, sum(table.shape) / 6, 0.05):
            yield from (Term("wave", -1, span / w), Term("difference", -2, span / w))


def _fitted(terms: tuple[Term, ...], x: Sequence[Array], v: Array, error: Array) -> TableFormula:
    parts = [t.columns(x) for t in terms]
    whole = np.concatenate(parts, axis=1)
    found = np.asarray(np.linalg.lstsq(whole / error[:, None], v / error)[0], float)
    left = (v - whole @ found) / error
    share = 1 - float(np.sum(left**2) / max(np.sum((v / error) ** 2), 1e-300))
    cuts = np.cumsum([p.shape[1] for p in parts])[:-1]
    return TableFormula(terms, tuple(np.split(found, cuts)), share, float(np.sqrt(np.mean(left**2))))


def _criterion(f: TableFormula, n: int) -> float:
    """Bayesian information criterion of values with known errors; a shape counts as a parameter."""
    parameters = sum(len(v) + (t.shape != 0) for t, v in zip(f.terms, f.values, strict=True))
    return n * f.error**2 + parameters * float(np.log(n))
