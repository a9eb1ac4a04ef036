"""``snarelab formulate``: a formula for an empirical law, by sparse regression over a small dictionary with units.

Every set of up to three kinds of terms is fitted and weighed by its evidence, beside the table without a formula
(`formula_search`; sparse regression: Brunton, Proctor and Kutz 2016). A rival is a set that does not hold the formula's
terms and is within the table's own error with no more terms, or loses by less evidence than one number costs.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.empirical import NAME, likelihood_of, table_values, tables_of
from ..models.model import Model
from ..models.table import Table
from ..report.words import percent
from .formula_search import Likelihood, WeighedFormula, likelihood, weighed_formulas
from .formula_terms import Term, identities

Array = NDArray[np.float64]

LEAST_ERROR = 0.02
"""Error of a table's values that is taken where none is stored [share of their RMS]."""


@dataclass(frozen=True)
class TableFormula:
    """Terms with their coefficients, the share of the table's energy they explain [0 to 1], their distance from the
    table in its own standard errors (RMS), and their probability beside all others and the table alone [0 to 1]."""

    terms: tuple[Term, ...]
    values: tuple[Array, ...]
    share: float
    error: float
    probability: float

    def words(self, table: Table) -> str:
        """The formula in symbols, with the factor."""
        names = [c.replace(" ", "_") for c in table.over]
        text = (
            " + ".join(t.words(names, v) for t, v in zip(self.terms, self.values, strict=True))
            .replace("+ -", "- ")
            .replace("- -", "+ ")
        )
        factor = {"": "", "direction": "sgn(qd)", "speed": "qd/peak", "driving": "[driving] sgn(qd)"}
        factor["braking"] = "[braking] sgn(qd)"
        return f"({text}) * {factor[table.times]}" if table.times else text


@dataclass(frozen=True)
class FormulaChoice:
    """A table's best formula, its rivals, which the table cannot tell from it, and the probability that it is none of
    the dictionary [0 to 1]."""

    at: str
    table: Table
    best: TableFormula
    rivals: tuple[TableFormula, ...]
    none: float

    @property
    def certain(self) -> bool:
        """Is there no rival, and the formula more probable than all else together?"""
        return not self.rivals and self.best.probability > 0.5

    def to_json(self) -> dict[str, Any]:
        """The published form."""

        def one(f: TableFormula) -> dict[str, Any]:
            words = {"formula": f.words(self.table)}
            return words | {"share": f.share, "error": f.error, "probability": f.probability}

        told = {"at": self.at, "over": self.table.words, "certain": self.certain, **one(self.best)}
        return told | {"rivals": [one(r) for r in self.rivals], "none": self.none}

    def __str__(self) -> str:
        """What the command prints."""
        lines = [
            f"{NAME} at {self.at} over {self.table.words}:",
            f"  {self.best.words(self.table)}   {percent(self.best.share, 3)} of it",
        ]
        lines += [f"  or, within its error: {r.words(self.table)}   {percent(r.share, 3)}" for r in self.rivals]
        if self.none >= self.best.probability:
            lines.append("  no formula of the dictionary is right: keep the table")
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
                seen = likelihood_of(t, p.at, model.values)
                found.append(formulate_table(p.at, t, table_values(t, p.at, model.values), std, seen))
    if not found:
        where = f" at {at!r}" if at else ""
        raise InputError(
            f"{model.path}: no [[{NAME}]] table{where}; 'snarelab diagnose --save-model' writes what has no name"
        )
    return found


def formulate_table(
    at: str, table: Table, values: Array, std: Array | None, seen: tuple[Array, Array] | None = None
) -> FormulaChoice:
    """A formula for one table: values and deviations in its shape, or what recordings say of it: curvature and score.

    Without curvature and score its deviations are taken as independent.
    """
    v = values.ravel()
    if seen is None:
        least = LEAST_ERROR * max(float(np.sqrt(np.mean(v**2))), 1e-300)
        error = np.zeros_like(v) if std is None else std.ravel()
        error = np.where(error > 0, error, least)
        of = likelihood(table, v, np.diag(error**-2), v / error**2, fitted=False)
    else:
        of = likelihood(table, v, *seen, fitted=True)
    found = weighed_formulas(of)
    if not found:
        raise InputError(f"{at}, table over {table.words}: it says nothing of any term; no formula")
    best = found[0]
    rivals = [
        c
        for c in found[1:]
        if not best.keys <= identities(c.keys)
        and (
            (len(c.terms) <= len(best.terms) and c.left <= max(len(of.y), best.left))
            or c.log_evidence > best.log_evidence - of.number
        )
    ]
    none = 1 - sum(c.probability for c in found)
    return FormulaChoice(at, table, _formula(best, of), tuple(_formula(c, of) for c in rivals[:5]), max(none, 0.0))


def _formula(c: WeighedFormula, of: Likelihood) -> TableFormula:
    share, error = 1 - c.left / of.energy, float(np.sqrt(c.left / len(of.y)))
    return TableFormula(c.terms, c.values, share, error, c.probability)
