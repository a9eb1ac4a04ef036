"""How often a name with some evidence is right: a logistic regression over names whose truth is known.

    p = 1 / (1 + exp(-(level + by_gain log(1 + gain) + by_held log(held) + by_share log(share / (1 - share)))))

``gain`` is a name's log Bayes factor on the training recordings, ``held`` what the held-out ones gain by it in standard
errors, ``share`` what part of their residual's energy goes with it. The four numbers are those of highest likelihood,
with a small ridge (le Cessie and van Houwelingen 1992), so that names which were never wrong make no certainty; more
evidence never makes a name less likely.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from snarelab.identification.reliability import LEAST

from .drives.judge import judge

Array = NDArray[np.float64]

RIDGE = 0.1
"""Precision of the normal prior of each number, the evidence measured from its mean: they are about 3 at most."""


class Row(NamedTuple):
    """A name that was told: its evidence, whether it was right, and the generator of its case."""

    gain: float
    held: float
    share: float
    right: bool
    generator: str


@dataclass(frozen=True)
class Counted:
    """``logit``: level, by_gain, by_held, by_share; ``skill``: by generator, the Brier skill of the map that leaves
    it out against the constant that is its own frequency of right names; None where there is no such map, or nothing
    to be told. ``brier``: over all rows, each by the map that leaves its generator out; None where there is but one."""

    logit: tuple[float, ...]
    skill: Mapping[str, float | None]
    brier: float | None


def counted(rows: Sequence[Row]) -> Counted:
    """The map over all rows, and how well each generator is predicted by the others.

    Raises
    ------
    ValueError
        Without a row, or where an evidence is no number.
    """
    if not rows:
        raise ValueError("no name was told: nothing can be counted; give more cases")
    found, errors = {}, 0.0
    names = sorted({r.generator for r in rows})
    for name in names:
        own, others = [r for r in rows if r.generator == name], [r for r in rows if r.generator != name]
        found[name] = skill(logit := fitted(others), own) if others else None
        errors += len(own) * brier(logit, own) if others else 0.0
    return Counted(fitted(rows), found, errors / len(rows) if len(names) > 1 else None)


def fitted(rows: Sequence[Row]) -> tuple[float, ...]:
    """Level, by_gain, by_held and by_share of some rows."""
    x, right = _evidence(rows), np.array([r.right for r in rows], float)
    mean = x.mean(axis=0)
    columns = np.column_stack([np.ones(len(x)), x - mean])

    def cost(w: Array) -> tuple[float, Array]:
        z = columns @ w
        value = float(np.sum(np.logaddexp(0.0, z) - right * z) + 0.5 * RIDGE * w @ w)
        return value, columns.T @ (1 / (1 + np.exp(-z)) - right) + RIDGE * w

    start, bounds = np.zeros(columns.shape[1]), [(None, None), *[(0.0, None)] * x.shape[1]]
    w = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-14, "gtol": 1e-9}).x
    return float(w[0] - w[1:] @ mean), *(float(v) for v in w[1:])


def probability(logit: Sequence[float], rows: Sequence[Row]) -> Array:
    """Of each row (n,)."""
    return 1 / (1 + np.exp(-(logit[0] + _evidence(rows) @ np.array(logit[1:]))))


def _evidence(rows: Sequence[Row]) -> Array:
    """log(1 + gain), log(held) and the log odds of the share (n, 3)."""
    every = np.array([[r.gain, r.held, r.share] for r in rows], float)
    if not np.isfinite(every).all():
        raise ValueError("a name's gain, held-out gain or share is no number")
    gain, held, share = every.T
    share = np.clip(share, LEAST, 1 - LEAST)
    return np.column_stack(
        [np.log1p(np.maximum(gain, 0.0)), np.log(np.maximum(held, LEAST)), np.log(share / (1 - share))]
    )


def brier(logit: Sequence[float], rows: Sequence[Row]) -> float:
    """Mean square error of a map's probabilities (Brier 1950)."""
    return float(np.mean((probability(logit, rows) - np.array([r.right for r in rows], float)) ** 2))


def skill(logit: Sequence[float], rows: Sequence[Row]) -> float | None:
    """Of a map against the constant that is the rows' own frequency; None where that is 0 or 1."""
    constant = float(np.var([r.right for r in rows]))
    return 1 - brier(logit, rows) / constant if constant > 0 else None


def of_effects(effects: Sequence[Mapping[str, Any]], right: Sequence[bool], generator: str) -> list[Row]:
    """Rows of a case's effects; names of encoders, which have no gain, are left out.

    Raises
    ------
    ValueError
        Where an effect was kept without its gain and margin.
    """
    found = []
    for effect, is_right in zip(effects, right, strict=True):
        if not {"gain", "margin", "explained"} <= set(effect):
            raise ValueError(
                f"{effect['name']} at {effect['at']} was kept without gain, margin and explained; diagnose it again"
            )
        if effect["gain"] is not None:
            gain, held, share = (float(effect[x]) for x in ("gain", "margin", "explained"))
            found.append(Row(gain, held, share, bool(is_right), generator))
    return found


def of_lines(lines: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Rows of what ``python -m proof.drives score`` kept of the second or third generator; names that are true of every
    case's background, and are neither right nor wrong, are left out."""
    found = []
    for line in lines:
        pairs = [(e, t.member) for e, t in zip(line["effects"], judge(line).told, strict=True) if not t.background]
        try:
            found += of_effects([e for e, _ in pairs], [right for _, right in pairs], generator_of(line))
        except ValueError as error:
            raise ValueError(f"{line['case']}: {error}") from None
    return found


def generator_of(line: Mapping[str, Any]) -> str:
    """Of a line that ``python -m proof.drives score`` kept."""
    return line["truth"]["generator"]
