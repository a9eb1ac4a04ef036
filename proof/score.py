"""The figures of a method over all cases: every case counts, none is dropped."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .cases import Answer
from .concealed import STRUCTURE
from .judge import SILENT, Diagnosed, Scored, is_physics, judge
from .statistics import bootstrap, calibration_error, clopper_pearson

DEVIATIONS = 2.0


@dataclass(frozen=True)
class Figure:
    """A figure of the score: mean, 95 % interval, how many cases stand behind it, the bar it is held to."""

    name: str
    value: float | None
    low: float | None
    high: float | None
    count: int
    bar: float | None = None
    at_most: bool = False
    meaning: str = ""

    @property
    def met(self) -> bool | None:
        """None where there is no bar, or nothing to hold to it."""
        if self.bar is None or self.value is None:
            return None
        return self.value <= self.bar if self.at_most else self.value >= self.bar


@dataclass(frozen=True)
class Score:
    """All cases of a method, and its figures by name."""

    cases: tuple[Scored, ...]
    figures: Mapping[str, Figure]


def score(
    answers: Sequence[Answer], found: Sequence[Diagnosed], oracles: Sequence[Mapping[str, float]] | None = None
) -> Score:
    """Score one method on all cases; without oracles, the floor stands for each."""
    every = zip(answers, found, oracles or [{}] * len(answers), strict=True)
    cases = tuple(judge(*case) for case in every)
    return Score(cases, {f.name: f for f in _figures(cases)})


def _share(
    name: str,
    cases: Sequence[Scored],
    right: Callable[[Scored], bool],
    bar: float | None,
    meaning: str,
    at_most: bool = False,
) -> Figure:
    count = sum(right(c) for c in cases)
    low, high = clopper_pearson(count, len(cases))
    value = count / len(cases) if cases else None
    return Figure(name, value, low, high, len(cases), bar, at_most, meaning)


def _figures(cases: Sequence[Scored]) -> list[Figure]:
    """The figures that the proof is held to, then those that explain them."""

    def group(*names: str, least: float = 0.0, most: float = np.inf) -> list[Scored]:
        return [c for c in cases if c.answer.group in names and least <= c.answer.size <= most]

    known = group("single", "swallowed", "decoy")
    named = [c for c in known if c.name]
    faults = [
        c
        for c in cases
        if c.answer.truths and all(not is_physics(t.name) and t.name not in STRUCTURE for t in c.answer.truths)
    ]
    faults += group("wrong")
    closures = [x for c in named if (x := c.closure) is not None]
    claims = [claim for c in cases for claim in c.claims]
    every = [c for c in cases if c.answer.truths]
    errors = [c.error[1] for c in every if c.error]
    to_floor = [x for c in named if (x := c.closure_to_floor) is not None]
    every_closure = [x for c in known if (x := c.closure) is not None]
    gone = [c for c in named if c.error]
    silent = all(c.verdict == SILENT for c in cases)
    moved = [] if silent else [m for c in cases for m in c.moved]
    found = [
        _share(
            "false_alarms",
            [] if silent else group("clean"),
            lambda c: c.verdict != "adequate",
            0.02,
            "clean recordings on which the verdict is not adequate",
            at_most=True,
        ),
        *(
            _share(
                f"name_at_{label}",
                group("single", "swallowed", "decoy", least=least, most=most),
                lambda c: c.name,
                bar,
                f"effects of {words} the disturbance named, and nothing else",
            )
            for label, least, most, bar, words in (
                ("0.5x", 0.5, 0.5, 0.75, "0.5 times"),
                ("1x", 1.0, 1.0, 0.9, "once"),
                ("2x", 2.0, np.inf, 0.95, "2 times and more"),
            )
        ),
        _share("place", named, lambda c: c.place, 0.95, "of those named rightly, the joint is right too"),
        _share(
            "unknown_recall",
            group("outside"),
            lambda c: c.verdict == "unknown_effect",
            0.9,
            "effects outside the vocabulary called unknown",
        ),
        _share("pairs", group("pair"), lambda c: c.name, 0.85, "pairs: both named, and nothing else"),
        _share(
            "not_blamed",
            [] if silent else faults,
            lambda c: not c.blamed and c.verdict in ("adequate", "missing_physics"),
            0.9,
            "wrong parameters and sensor faults that no physics is blamed for",
        ),
        Figure(
            "closure_median",
            _median(closures),
            *_interval(closures, _median),
            len(closures),
            0.9,
            meaning="share of the avoidable error on the third recording that naming removes, median over rightly "
            "named cases; avoidable: what the oracle, a fit of the same arm with nothing concealed, does not leave",
        ),
        Figure(
            "closure_worst",
            min(closures, default=None),
            None,
            None,
            len(closures),
            0.7,
            meaning="the same, in the worst rightly named case",
        ),
        Figure(
            "calibration_error",
            calibration_error(*zip(*claims, strict=True)) if claims else None,
            *_interval(claims, lambda some: calibration_error(*zip(*some, strict=True))),
            len(claims),
            0.05,
            True,
            "expected calibration error of the probabilities of all classes named",
        ),
        _share(
            "error_returns",
            gone,
            lambda c: c.error is not None and c.error[0] > 1.02 * c.error[1],
            0.95,
            "inverse test: without the name the error on the third recording is at least 2 % higher again",
        ),
        _share(
            "decoys",
            group("decoy"),
            lambda c: c.name and c.place,
            0.95,
            "effects that show most at another joint, named at their own",
        ),
        _share(
            "swallowed",
            group("swallowed"),
            lambda c: c.name,
            0.95,
            "load-dependent friction that refitted friction has swallowed half of, named",
        ),
        _share(
            "first_name",
            known,
            lambda c: c.first,
            None,
            "the first name given is right, whatever else is named: all sizes, decoys and swallowed ones",
        ),
        *(
            Figure(
                f"closure_to_floor_{label}",
                value,
                None,
                None,
                len(to_floor),
                meaning=f"{label} closure with disturbance and noise alone for an oracle",
            )
            for label, value in (("median", _median(to_floor)), ("worst", min(to_floor, default=None)))
        ),
        Figure(
            "closure_all",
            _median(every_closure),
            *_interval(every_closure, _median),
            len(every_closure),
            None,
            meaning="closure, median over all cases with one concealed effect, whatever was said",
        ),
        Figure(
            "third_error",
            _median(errors),
            *_interval(errors, _median),
            len(errors),
            None,
            True,
            "RMS on the third recording over its floor, median over all cases with a named truth, whatever was said",
        ),
        _covered([abs(d) <= DEVIATIONS for c in cases for d in c.deviations]),
        Figure(
            "right_moved",
            float(np.mean(moved)) if moved else None,
            *(clopper_pearson(sum(moved), len(moved)) if moved else (None, None)),
            len(moved),
            None,
            True,
            "masses and rotors that were right and are said to be wrong, of all that were right",
        ),
        Figure(
            "class_size",
            _median([float(n) for c in cases for n in c.sizes]),
            None,
            None,
            len(claims),
            None,
            True,
            "names in a class, median",
        ),
    ]
    return found


def _covered(inside: Sequence[bool]) -> Figure:
    """After selection: only names that were told have values."""
    low, high = clopper_pearson(sum(inside), len(inside))
    value = float(np.mean(inside)) if inside else None
    return Figure(
        "coverage", value, low, high, len(inside), 0.9, False, "true values of right names within two deviations"
    )


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if len(values) else None


def _interval(values: Sequence, statistic: Callable) -> tuple[float | None, float | None]:
    return bootstrap(values, statistic) if len(values) > 1 else (None, None)
