"""Typical misses of a study, played: one page each, linked from its report."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from .results import Results
from .study import Study
from .summary import to_unit

Case = dict[Any, Any]
"""A row of the table of cases."""

_KINDS = {
    "never touched": "no cable touched the pin, and the snare closed beside it",
    "escaped": "the pin was touched, but is outside the closed snare",
    "off the axis": "the pin is caught, but too far off the axis to be docked",
    "cable overloaded": "the pin is caught and in place, but a cable was over its strength",
}


@dataclass(frozen=True)
class Miss:
    """A miss that was played: its file in the results folder, its kind, and in words what happened where."""

    file: str
    kind: str
    text: str


def typical_misses(study: Study, table: pd.DataFrame, count: int = 3) -> list[tuple[str, Case]]:
    """Up to ``count`` misses, each with its kind: of every kind the one in the middle, then more of the commonest.

    The one in the middle is the case that is nearest to the kind's median over the varied axes, ranges taken as one;
    one more of a kind is the one that is farthest from those taken.
    """
    kinds: dict[str, list[Case]] = {}
    for row in table.to_dict("records"):
        kind = kind_of_miss(study, row)
        if kind:
            kinds.setdefault(kind, []).append(row)
    order = sorted(kinds, key=lambda kind: (-len(kinds[kind]), kind))
    places = {kind: _places(study, kinds[kind]) for kind in order}
    taken: dict[str, list[int]] = {}
    for kind in order[:count]:
        apart = np.linalg.norm(places[kind] - np.median(places[kind], axis=0), axis=1)
        taken[kind] = [int(np.argmin(apart))]
    for kind in order[:count]:
        while sum(map(len, taken.values())) < count and len(taken[kind]) < len(kinds[kind]):
            apart = np.linalg.norm(places[kind][:, None] - places[kind][None, taken[kind]], axis=2).min(axis=1)
            taken[kind].append(int(np.argmax(apart)))
    return [(kind, kinds[kind][i]) for kind, chosen in taken.items() for i in chosen]


def play_misses(study: Study, results: Results) -> list[Miss]:
    """Simulate typical misses once more and write their pages; one that is there already is kept."""
    film, played = study.capture.film, []
    if film is None:
        return played
    for kind, case in typical_misses(study, results.table("space")):
        file = f"miss-{case['case']:07d}.html"
        values = {axis.name: float(case[axis.name]) for axis in study.capture.axes}
        if not (results.folder / file).exists():
            results.write(file, film(values))
        played.append(Miss(file, kind, f"{_KINDS[kind]}: {_where(study, values)}; {_outcome(case)}"))
    return played


def kind_of_miss(study: Study, case: Case) -> str:
    """What went wrong; empty for a success, and for a case without a result, which cannot be played."""
    if case["margin"] > 0 or case["reason"]:
        return ""
    if not case["enclosed"]:
        return "never touched" if np.isnan(case["first_contact"]) else "escaped"
    return "off the axis" if case["radial_error"] >= study.success.radial_error else "cable overloaded"


def _places(study: Study, cases: list[Case]) -> np.ndarray:
    return to_unit(study, np.array([[case[name] for name in study.ranges] for case in cases]))


def _where(study: Study, values: dict[str, float]) -> str:
    units = {name: study.capture.axis(name).unit.removeprefix("1") for name in study.ranges}
    return ", ".join(f"{name} {values[name]:.3g} {units[name]}".rstrip() for name in study.ranges)


def _outcome(case: Case) -> str:
    contact = "" if np.isnan(case["first_contact"]) else f"first contact at {case['first_contact']:.2f} s, "
    return f"{contact}{1e3 * case['radial_error']:.1f} mm off at the end"
