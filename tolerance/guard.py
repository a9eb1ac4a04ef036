"""The numbers of captures that a change in physics must not move unseen, and how they are found again.

They stand in one file, ``tests/tolerances.toml``, each with how far it may move: ``[ground]``, the paper's ground test;
``[envelope]``, how far single axes of that test may go; ``[arrival]``, the paper's inspection capture, and the share of
captures that succeed from 20 mm and 2 degrees in other directions, whatever the friction; and ``[latched]``, the
paper's hover capture on to the latch. After a change that was meant to move them,
``python -m snarelab.tolerance.renew`` writes them anew.

An end of the envelope is found by halving, from the nominal case outwards along one axis. To check it, two captures
are enough: one that is nearer by what is allowed must succeed, one that is farther by it must not.
"""

import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from . import ground, inspection, latched
from .capture import Capture, Outcome, run_case
from .run import box_points
from .study import Success, load_study

SUCCESS = Success(radial_error=0.010, strength=8000.0)
PAPER = {"radial_y": 0.0747, "radial_z": 0.0402, "roll": 0.069, "pitch": -0.015, "yaw": -0.022}
"""Misalignment of the paper's ground test [m, rad]."""
_TILT = math.radians(2.0)
ARRIVAL = {"radial_y": 0.02, "radial_z": 0.02, "roll": _TILT, "pitch": _TILT, "yaw": _TILT}
"""Misalignment of the paper's captures in orbit [m, rad]."""
FARTHEST = {"radial_y": 0.08, "radial_z": 0.08, "pitch": 0.3, "yaw": 0.3}
"""Axes whose envelope is guarded, and how far its end is looked for [m, rad]."""
DIRECTIONS = 4
"""Captures of the share of successes: the first of those that the inspection study runs in its box."""


@dataclass(frozen=True)
class GuardedNumber:
    """One number of the file: its value, how far it may move either way, and the unit of both."""

    value: float
    allowed: float
    unit: str


@dataclass(frozen=True)
class GuardShift:
    """A number that has moved by more than it may."""

    name: str
    before: GuardedNumber
    after: float

    def __str__(self) -> str:
        """Before, after, allowed, in one line."""
        b = self.before
        return f"{self.name}: was {b.value:.6g} {b.unit}, is {self.after:.6g}, allowed is a change of {b.allowed:.6g}"


def load(path: str | Path) -> dict[str, dict[str, GuardedNumber]]:
    """The file's numbers by section and name; raises InputError where it cannot be used."""
    try:
        raw = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        return {
            section: {
                name: GuardedNumber(float(n["value"]), float(n["allowed"]), str(n["unit"])) for name, n in rows.items()
            }
            for section, rows in raw.items()
        }
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); name the file of guarded numbers") from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: each number needs value, allowed and unit ({error}); correct that line") from None


def moved(section: str, before: Mapping[str, GuardedNumber], after: Mapping[str, float]) -> list[GuardShift]:
    """Which numbers of a section have moved too far; one that is not a number any more has."""
    return [
        GuardShift(f"{section}.{name}", guarded, after[name])
        for name, guarded in before.items()
        if not abs(after[name] - guarded.value) <= guarded.allowed
    ]


def ground_numbers() -> dict[str, float]:
    """Of the paper's ground test; one capture."""
    return _numbers(_run(ground.CAPTURE, PAPER))


def arrival_numbers() -> dict[str, float]:
    """Of the paper's inspection capture, and the share of successes from other directions; five captures."""
    study = load_study(Path(__file__).with_name("inspection.toml"))
    others = [run_case(study.capture, study.values(point)) for point in box_points(study)[:DIRECTIONS]]
    share = float(np.mean([SUCCESS.margin(outcome) > 0 for outcome in others]))
    return {**_numbers(_run(inspection.CAPTURE, ARRIVAL)), "share_of_successes": share}


def latched_numbers() -> dict[str, float]:
    """Of the paper's hover capture to the latch, its margin of that among them; one capture."""
    outcome = _run(latched.HOVER, ARRIVAL)
    return {name: getattr(outcome, name) for name in ("first_contact", "radial_error", "peak_force", "latched")}


def succeeds(axis: str, value: float) -> bool:
    """Whether the ground test's capture does with one axis at a value, the others at nominal."""
    return SUCCESS.margin(_run(ground.CAPTURE, {axis: value})) > 0


def envelope_end(axis: str, exact: float) -> float:
    """Where success ends on an axis, to within ``exact``: zero where the nominal case fails, the farthest if none does.

    Halving takes it that there is one end within `FARTHEST`.
    """
    return halved(lambda value: succeeds(axis, value), FARTHEST[axis], exact)


def halved(good: Callable[[float], bool], farthest: float, exact: float) -> float:
    """Middle of the last interval, no longer than ``exact``, between a good value and one that is not."""
    low, high = 0.0, farthest
    if not good(low):
        return low
    if good(high):
        return high
    while high - low > exact:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return 0.5 * (low + high)


def end_holds(axis: str, end: GuardedNumber) -> bool:
    """Whether the end of an axis is still where it was, from two captures."""
    return succeeds(axis, end.value - end.allowed) and not succeeds(axis, end.value + end.allowed)


def _run(capture: Capture, values: Mapping[str, float]) -> Outcome:
    return run_case(capture, {**{a.name: a.nominal for a in capture.axes}, **values})


def _numbers(outcome: Outcome) -> dict[str, float]:
    return {name: getattr(outcome, name) for name in ("first_contact", "radial_error", "peak_force", "peak_tension")}
