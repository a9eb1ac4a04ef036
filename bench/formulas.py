"""Formulas for tables: how often `snarelab formulate` is right, and how often it is sure and wrong, beside rivals.

``python bench/formulas.py [RESULT.json] [--seeds N] [--only WORD]``. Laws of joints (`bench/formula_laws.py`) act along
a simulated motion, beside friction and a disturbance that a Markov process makes (0.3 s). What is left is tabulated as
a diagnosis does it (`identification/tabulating.py`), with viscous and Coulomb friction free beside the table. A law's
size is what such friction leaves of it: once, twice and four times the disturbance's RMS. Some laws are outside the
dictionary: there no formula is right.

Right: the law's terms and no other, coefficients and shapes within 10 % (a wave by its amplitude). A constant is not
counted, since friction by direction may be it. Sure and wrong: called certain, with other terms than the law's. Error:
of the formula against the law on points between the knots, but for what friction takes of both, as a share of the law's
RMS; median.

Rivals, on the same values weighted by their deviations: PySINDy's STLSQ and SR3 (Brunton, Proctor and Kutz 2016; Zheng
et al. 2019) over the same dictionary on its grid of shapes, with the one threshold of eight that is right most often,
and FROLS (Billings 2013), with the one number of columns of seven; that choice knows the answers and flatters them. SSR
would take a column at a time out of a thousand, and is left out.
PySR (Cranmer 2023) is run where it and Julia are installed, 30 s a table, and only its error counts: its terms are its
own.
"""

import argparse
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bench.formula_laws import LAWS, Law
from bench.formula_rivals import Found, missing, pysindy_formulas, pysr_values
from bench.results import write_result
from snarelab.identification.formula_terms import Term
from snarelab.identification.formulate import FormulaChoice, formulate_table
from snarelab.identification.tabulating import Rest, tabulate
from snarelab.models.empirical import likelihood_of, table_values
from snarelab.models.table import Table

Array = NDArray[np.float64]

RATE, SECONDS, CORRELATED, WITHIN, PYSR_SECONDS = 50.0, 60.0, 0.3, 0.1, 30.0
TIMES = (1, 2, 4)
OURS = "snarelab formulate"


@dataclass(frozen=True)
class Case:
    """A law at a size, the table that is made of it, and points between the knots with their true values."""

    law: Law
    times: int
    size: float
    table: Table
    values: Array
    std: Array
    seen: tuple[Array, Array]
    points: list[Array]
    friction: Array
    true: Array


def motion(rng: np.random.Generator) -> dict[str, Array]:
    """Two joints along finite Fourier series, within ±1.3 rad."""
    t = np.arange(0, SECONDS, 1 / RATE)
    turn = 2 * np.pi * np.array([0.07, 0.13, 0.21, 0.34])
    found = {"time": t}
    for name in ("", " of b"):
        phase = rng.uniform(0, 2 * np.pi, len(turn))
        angles = turn * t[:, None] + phase
        q, qd, qdd = (np.sum(x, axis=1) for x in (np.sin(angles), np.cos(angles) * turn, -np.sin(angles) * turn**2))
        to = 1.3 / np.abs(q).max()
        found |= {f"position{name}": to * q, f"rate{name}": to * qd, f"gain{name}": to * qdd}
    found["speed"] = np.abs(found["rate"])
    found["load"] = 5.0 * np.sin(found["position"] + 0.3) + 2.0 * found["gain"]
    return found


def white(x: Array) -> Array:
    """Rows (n, ...) of a Markov process of unit variance, made independent: the inverse root of its covariance."""
    kept = np.exp(-1 / (RATE * CORRELATED))
    return np.concatenate([x[:1], (x[1:] - kept * x[:-1]) / np.sqrt(1 - kept**2)])


def inverse(x: Array) -> Array:
    """The inverse covariance of that process times columns (n, k)."""
    kept, y = np.exp(-1 / (RATE * CORRELATED)), white(x)
    back = y / np.sqrt(1 - kept**2)
    back[0] = y[0]
    back[:-1] -= kept / np.sqrt(1 - kept**2) * y[1:]
    return back


def cases(law: Law, seed: int) -> Iterator[Case]:
    """The law at each size, with one motion and one disturbance."""
    rng = np.random.default_rng([seed, sum(map(ord, law.name))])
    m = motion(rng)
    kept = np.exp(-1 / (RATE * CORRELATED))
    shocks = rng.normal(size=len(m["time"]))
    shocks[1:] *= np.sqrt(1 - kept**2)
    disturbance = np.asarray(lfilter([1.0], [1.0, -kept], shocks))
    sign = np.sign(m["rate"])
    friction = np.stack([m["rate"], sign], 1)
    x = [m[c] for c in law.over]
    factor = {"": np.ones_like(sign), "direction": sign}[law.times]
    shape = law.value(*x) * factor
    left = shape - friction @ np.linalg.lstsq(friction, shape)[0]
    for times in TIMES:
        size = times / float(np.sqrt(np.mean(left**2)))
        torque = size * shape + friction @ [0.5, 2.0] + disturbance
        # The residual of a fit of friction, which stays free beside the table.
        residual = torque - friction @ np.linalg.lstsq(friction, torque)[0]
        rest = Rest(residual, friction, lambda c: c, inverse)
        (table,), known = tabulate(
            "a", [(law.over, law.times)], [[[*x, factor]]], [rest], float(np.sqrt(np.mean(torque**2)))
        )
        seen = likelihood_of(table, "a", known)
        assert seen is not None
        values, std = (table_values(table, "a", known, what).ravel() for what in ("", "std."))
        grid = [np.linspace(k[0], k[-1], 5 * len(k))[1:-1] for k in table.knots]
        points = [g.ravel() for g in np.meshgrid(*grid, indexing="ij")]
        # By direction over the speed, friction is a constant and a line; by direction, a constant.
        free = [np.ones_like(points[0])] if law.times else []
        free += [points[0]] if law.times and law.over == ("speed",) else []
        taken = np.stack(free, 1) if free else np.zeros((len(points[0]), 0))
        yield Case(law, times, size, table, values, std, seen, points, taken, size * law.value(*points))


def right(found: Found, case: Case, within: float = WITHIN) -> bool:
    """The law's terms and no other, within a share of their coefficients and shapes."""
    merged: list[tuple[Term, Array]] = []
    for t, v in sorted(found, key=lambda x: (x[0].key, x[0].shape)):
        # Neighbours on a grid of shapes are one term.
        if merged and merged[-1][0].key == t.key and abs(t.shape - merged[-1][0].shape) <= WITHIN * abs(t.shape):
            merged[-1] = (t, merged[-1][1] + v)
        elif t.key != ("constant", 0):
            merged.append((t, v))
    terms = [(t, float(np.linalg.norm(v)) if len(v) > 1 else float(v[0])) for t, v in merged]
    wanted = sorted(case.law.terms, key=lambda x: (x[0], x[2]))
    told = sorted(terms, key=lambda x: (x[0].key, x[0].shape))
    if not wanted or [t.key for t, _ in told] != [key for key, _, _ in wanted]:
        return False
    off = [abs(v / (case.size * a) - 1) for (_, v), (_, a, _) in zip(told, wanted, strict=True)]
    off += [abs(t.shape / s - 1) for (t, _), (_, _, s) in zip(told, wanted, strict=True) if t.shaped]
    return bool(max(off) <= within)


def error(values: Array, case: Case) -> float:
    """Of values at the points, as a share of the law, but for what friction takes of both."""

    def rest(y: Array) -> Array:
        return y - case.friction @ np.linalg.lstsq(case.friction, y)[0] if case.friction.size else y

    return float(np.linalg.norm(rest(values - case.true)) / np.linalg.norm(rest(case.true)))


def drawn(found: Found, case: Case) -> Array:
    """A formula at the points."""
    return sum((t.columns(case.points) @ v for t, v in found), np.zeros(len(case.points[0])))


def scored(name: str, found: Found, case: Case, **more: Any) -> dict[str, Any]:
    row = {"tool": name, "law": case.law.name, "inside": bool(case.law.terms), "times": case.times}
    return row | {"right": right(found, case), "error": error(drawn(found, case), case), **more}


def ours(case: Case) -> dict[str, Any]:
    start = time.process_time()
    choice: FormulaChoice = formulate_table("a", case.table, case.values, case.std, case.seen)
    spent = time.process_time() - start
    found = list(zip(choice.best.terms, choice.best.values, strict=True))
    told: dict[str, Any] = {"terms": right(found, case, np.inf)}
    told |= {"certain": choice.certain, "probability": choice.best.probability, "none": choice.none}
    rivals = [list(zip(r.terms, r.values, strict=True)) for r in choice.rivals]
    told |= {"among": any(right(f, case) for f in (found, *rivals))}
    return scored(OURS, found, case, seconds=spent, formula=choice.best.words(case.table), **told)


def theirs(case: Case, absent: list[str]) -> Iterator[dict[str, Any]]:
    std = np.maximum(case.std, 1e-9 * np.abs(case.values).max())
    for which in ("STLSQ", "SR3", "FROLS") if "pysindy" not in absent else ():
        for threshold, found in pysindy_formulas(case.table, case.values, std, which).items():
            yield scored(f"PySINDy {which}", found, case, threshold=threshold)
    if "pysr" not in absent:
        values = pysr_values(case.table, case.values, std, case.points, PYSR_SECONDS)
        row = {"tool": "PySR", "law": case.law.name, "inside": bool(case.law.terms), "times": case.times}
        yield row | {"right": False, "error": error(values, case)}


def best_threshold(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of each tool that has thresholds, the rows of the one that is right most often, and least wrong then."""
    kept = []
    for tool in dict.fromkeys(r["tool"] for r in rows):
        own = [r for r in rows if r["tool"] == tool]
        by = {t: [r for r in own if r.get("threshold") == t] for t in {r.get("threshold") for r in own}}
        kept += max(by.values(), key=lambda x: (sum(r["right"] for r in x), -np.median([r["error"] for r in x])))
    return kept


def summary(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A line for each tool and size."""
    lines = []
    for tool in dict.fromkeys(r["tool"] for r in rows):
        for times in TIMES:
            own = [r for r in rows if (r["tool"], r["times"]) == (tool, times)]
            inside = [r for r in own if r["inside"]]
            if not inside:
                continue
            line = {"tool": tool, "times": times, "tables": len(own), "inside": len(inside)}
            line |= {"right": sum(r["right"] for r in inside), "error": float(np.median([r["error"] for r in inside]))}
            if tool == OURS:
                line |= {"among": sum(r["among"] for r in inside), "certain": sum(r["certain"] for r in own)}
                line |= {"sure_and_wrong": sum(r["certain"] and not r["terms"] for r in own)}
                line |= {"terms": sum(r["terms"] for r in inside)}
                line |= {"seconds": float(np.median([r["seconds"] for r in own]))}
            lines.append(line)
    return lines


def main() -> int:
    """Make the tables, formulate, compare, print and write."""
    parser = argparse.ArgumentParser()
    parser.add_argument("result", nargs="?", type=Path, default=Path("build/bench/formulas.json"))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", default="", help="laws with this word in their names")
    given = parser.parse_args()
    absent, rows = missing(), []
    for name in absent:
        print(f"{name} is not installed: not compared")
    for law in (x for x in LAWS if given.only in x.name):
        for seed in range(given.seeds):
            for case in cases(law, seed):
                rows += [ours(case), *theirs(case, absent)]
                told = next(r for r in reversed(rows) if r["tool"] == OURS)
                words = "right" if told["right"] else "none is right" if not told["inside"] else "WRONG"
                sure = "certain" if told["certain"] else "not certain"
                print(
                    f"{law.name}, x {case.times}: {words}, {sure}, none {told['none']:.2f}: {told['formula']}",
                    flush=True,
                )
    rows = best_threshold(rows)
    lines = summary(rows)
    heads = ("right", "of", "terms", "among", "certain", "sure, wrong", "error", "CPU s")
    print(f"\n{'':22}{'times':>6}" + "".join(f"{h:>12}" for h in heads))
    for s in lines:
        cells = [s.get(k, "") for k in ("right", "inside", "terms", "among", "certain", "sure_and_wrong")]
        cells += [f"{s['error']:.1%}", f"{s['seconds']:.1f}" if "seconds" in s else ""]
        print(f"{s['tool']:22}{s['times']:6}" + "".join(f"{c:>12}" for c in cells))
    result = {"bench": "formulas", "laws": len(LAWS), "seeds": given.seeds, "missing": absent}
    write_result(given.result, result | {"summary": lines, "rows": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
