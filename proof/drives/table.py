"""The figures of a file of answers, as numbers and as a printed table."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from proof.statistics import calibration_error, clopper_pearson

from .cases import CLEAN, FAULTY, LAWLESS, PAIR, SINGLE, SIZES
from .judge import Judged, judge
from .motions import KINDS, WANDERING

DEVIATIONS = 2.0


@dataclass(frozen=True)
class Figure:
    """A figure: its value, None where nothing stands behind it; how many do; a 95 % interval where it is a share."""

    name: str
    value: float | None
    count: int
    interval: tuple[float, float] | None = None
    share: bool = True

    def __str__(self) -> str:
        """One row of the table."""
        if self.value is None:
            return f"{self.name:<62}     n/a{self.count:>6}"
        text = f"{100.0 * self.value:.1f} %" if self.share else f"{self.value:.3g}"
        between = "" if self.interval is None else f"  {100 * self.interval[0]:.0f} to {100 * self.interval[1]:.0f} %"
        return f"{self.name:<62}{text:>8}{self.count:>6}{between}"


def read(path: Path) -> list[Judged]:
    """Every case of a file of `score.score`."""
    return [judge(json.loads(x)) for x in path.read_text(encoding="utf-8").splitlines()]


def table(cases: Sequence[Judged]) -> str:
    """All figures, one a row."""
    head = f"{'figure':<62}{'value':>8}{'n':>6}  95 %"
    return "\n".join([head, *(str(f) for f in figures(cases))])


def figures(cases: Sequence[Judged]) -> list[Figure]:
    """Every figure of the proof."""
    clean = [c for c in cases if c.group == CLEAN]
    rows = [_count("clean: a false name", [bool(c.wrong) for c in clean])]
    rows += [
        _count(f"clean, {kind}: a false name", [bool(c.wrong) for c in clean if c.disturbance == kind])
        for kind in KINDS
    ]
    rows += [
        _count("wandering, all groups: a false name", [bool(c.wrong) for c in cases if c.disturbance == WANDERING]),
        _count("clean: any name at all, also those true of the background", [bool(c.told) for c in clean]),
        _count("clean: told that something has no name", [c.nameless for c in clean]),
    ]
    single = [c for c in cases if c.group == SINGLE]
    for size in SIZES:
        own = [f for c in single if c.size == size for f in c.found]
        rows.append(_count(f"single {size:g}x: its name at its place", [f.placed for f in own]))
        rows.append(_mean(f"single {size:g}x: the same, members of a told class count half", [f.credit for f in own]))
        rows.append(
            _count(f"single {size:g}x: told, and nothing wrong besides", [c.whole for c in single if c.size == size])
        )
    large = [f for c in single if c.size >= 2.0 for f in c.found]
    rows.append(_count("single 2x and above: its name at its place", [f.placed for f in large]))
    several = [c for c in cases if c.group == PAIR]
    pairs, more = [c for c in several if len(c.found) == 2], [c for c in several if len(c.found) > 2]
    faults = [c for c in cases if c.fault]
    every = [f for c in cases for f in c.found]
    rows += [
        _count("pairs: both told, and nothing wrong besides", [c.whole for c in pairs]),
        _count("three and four at once: all told, and nothing wrong besides", [c.whole for c in more]),
        _count("pairs and more: effects named at their place", [f.placed for c in several for f in c.found]),
        _count("a parameter or a sensor is wrong: physics not blamed", [not c.blamed for c in faults]),
        _count("place right, of names that are told", [f.placed for f in every if f.named]),
        _count("place right, of names and members that are told", [f.member for f in every if f.anywhere]),
        _mean("wrong names a case", [float(len(c.wrong)) for c in cases], share=False),
        _mean("wrong names a case where nothing is concealed", [float(len(c.wrong)) for c in clean], share=False),
        _mean(
            "wrong names a case, those true of the background too",
            [float(sum(not t.member for t in c.told)) for c in cases],
            share=False,
        ),
    ]
    lawless = [c for c in cases if c.group == LAWLESS]
    rows += [
        _count("laws without a name: told as unknown", [c.unknown for c in lawless]),
        _count("laws without a name 2x and above: told as unknown", [c.unknown for c in lawless if c.size >= 2.0]),
        _count(
            "laws without a name: told as unknown, loudest at its channel", [c.unknown and c.located for c in lawless]
        ),
        _count("laws without a name: a wrong name instead", [bool(c.wrong) for c in lawless]),
    ]
    faulty = [c for c in cases if c.group == FAULTY]
    rows += [
        _count("faulty recordings: told as a fault of the data", [c.verdict == "data_fault" for c in faulty]),
        _count("faulty recordings: physics named", [bool(c.told) for c in faulty]),
    ]
    rows += _closures("single, told rightly", [c for c in single if c.whole])
    rows += _closures("single", single)
    rows += _closures("laws without a name, told", [c for c in lawless if c.unknown])
    claims = [(t.probability, t.member) for c in cases for t in c.told if not t.background]
    strict = [(t.probability, t.first) for c in cases for t in c.told]
    rows += [*_brier("names told", claims), *_brier("names told, strict: the background's are wrong", strict)]
    inside = [abs(d) <= DEVIATIONS for f in every for d in f.deviations]
    rows += [
        _count("true values of right names within two deviations", inside),
        _count(
            "true values of known friction within two deviations (clean)",
            [abs(d) <= 2.0 for c in clean for d in c.known],
        ),
        _count("no answer: failed or out of time", [c.verdict in ("failed", "out of time") for c in cases]),
    ]
    seconds = [c.seconds for c in cases]
    rows.append(Figure("median seconds", float(np.median(seconds)) if seconds else None, len(seconds), share=False))
    rows.append(Figure("most seconds", max(seconds, default=None), len(seconds), share=False))
    return rows


def _count(name: str, hits: Iterable[bool]) -> Figure:
    some = list(hits)
    if not some:
        return Figure(name, None, 0)
    return Figure(name, sum(some) / len(some), len(some), clopper_pearson(sum(some), len(some)))


def _mean(name: str, values: Sequence[float], share: bool = True) -> Figure:
    return Figure(name, float(np.mean(values)) if values else None, len(values), share=share)


def _closures(name: str, cases: Sequence[Judged]) -> list[Figure]:
    """How far the errors of cases close on the recording that nothing was given: median and worst."""
    closed = [c.closure for c in cases if c.closure is not None]
    return [
        Figure(
            f"{name}: closure on the third recording, median", float(np.median(closed)) if closed else None, len(closed)
        ),
        Figure(f"{name}: closure on the third recording, worst", min(closed, default=None), len(closed)),
    ]


def _brier(name: str, claims: Sequence[tuple[float, bool]]) -> list[Figure]:
    """Brier score, and its skill against a constant of the same mean as the outcomes."""
    if not claims:
        none = ("Brier score of", "Brier skill of", "calibration error of")
        return [Figure(f"{what} {name}", None, 0) for what in none]
    p, right = np.array(claims, dtype=float).T
    score, constant = float(np.mean((p - right) ** 2)), float(np.mean((right - right.mean()) ** 2))
    skill = 1.0 - score / constant if constant > 0.0 else None
    return [
        Figure(f"Brier score of {name}", score, len(claims), share=False),
        Figure(f"Brier skill of {name}", skill, len(claims), share=False),
        Figure(f"calibration error of {name}", calibration_error(p, right), len(claims), share=False),
        Figure(f"mean probability of {name}", float(p.mean()), len(claims), share=False),
        Figure(f"share right of {name}", float(right.mean()), len(claims), share=False),
    ]
