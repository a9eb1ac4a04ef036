"""The study file (TOML): what is varied over which ranges, what success means, and how cases are chosen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import toml_table
from .capture import Capture, Outcome, find_capture
from .given import count, flag, known, number, positive, table, text
from .ways import Ways, read_ways

SAMPLINGS = ("adaptive", "sobol", "latin_hypercube")
LARGEST = 1000
"""Cases that a boundary is fitted to at most: the time of a fit grows with their cube, to half a minute here."""
_KEYS = (
    "name",
    "capture",
    "seed",
    "sampling",
    "batch",
    "cases",
    "width",
    "ranges",
    "fixed",
    "success",
    "box",
    "envelope",
)
_SUCCESS = ("radial_error", "strength", "latched")


@dataclass(frozen=True)
class Success:
    """What counts as a capture: pin enclosed, little radial error at the end, no cable over its strength.

    Parameters
    ----------
    radial_error : float
        What the rigid docking mechanism takes [m].
    strength : float
        Breaking load of a cable [N].
    latched : bool
        Success is the latch, and its margin the capture's own; the two numbers then make the proxy beside it.
    """

    radial_error: float
    strength: float
    latched: bool = False

    def margin(self, outcome: Outcome) -> float:
        """Signed distance from failure as a share of the limit, in -1 to 1; above zero is a success.

        The smallest of 1 - radial_error/limit and 1 - tension/strength; -1 where the pin is not enclosed. Where success
        is the latch, the capture's own margin of that.
        """
        if not self.latched:
            return self.proxy(outcome)
        return -1.0 if outcome.reason or not np.isfinite(outcome.latched) else float(outcome.latched)

    def proxy(self, outcome: Outcome) -> float:
        """The margin by radial error and strength alone, whatever comes after the soft capture."""
        if outcome.reason or not outcome.enclosed:
            return -1.0
        worst = min(1.0 - outcome.radial_error / self.radial_error, 1.0 - outcome.peak_tension / self.strength)
        return float(np.clip(worst, -1.0, 1.0))


@dataclass(frozen=True)
class Study:
    """A study file, read and checked.

    Parameters
    ----------
    path : Path
    name : str
    capture : Capture
    seed : int
    sampling : str
        One of `SAMPLINGS`.
    batch : int
        Cases that are chosen together.
    cases : int
        Most cases that are run to find the boundary.
    width : float
        Adaptive sampling stops where at most this share of the ranges' volume is undecided, twice running.
    ranges : mapping of str to (low, high)
        The varied axes.
    fixed : mapping of str to float
        Axes held at another value than their nominal one.
    success : Success
    box : mapping of str to (low, high)
        A part of the ranges whose probability of success is wanted by itself.
    box_cases : int
        Cases that are run for it.
    box_ends : bool
        Each axis of the box stands at one of its two ends, by chance; else they are drawn evenly between.
    envelope : Ways or None
        Captures along single axes that are run, too.
    """

    path: Path
    name: str
    capture: Capture
    seed: int
    sampling: str
    batch: int
    cases: int
    width: float
    ranges: Mapping[str, tuple[float, float]]
    fixed: Mapping[str, float]
    success: Success
    box: Mapping[str, tuple[float, float]]
    box_cases: int
    box_ends: bool = False
    envelope: Ways | None = field(default_factory=Ways)

    def scaled(self, unit: np.ndarray) -> np.ndarray:
        """Points of the unit cube, shape (n, n_ranges), as values of the varied axes."""
        low, high = np.array(list(self.ranges.values())).T
        return low + unit * (high - low)

    def values(self, point: np.ndarray) -> dict[str, float]:
        """Every axis' value for one point of the varied axes, shape (n_ranges,)."""
        nominal = {a.name: a.nominal for a in self.capture.axes}
        return {**nominal, **self.fixed, **dict(zip(self.ranges, map(float, point), strict=True))}

    def identity(self) -> dict[str, Any]:
        """All that decides the cases and their outcomes: results of another identity cannot be continued."""
        return {
            "capture": self.capture.name,
            "version": self.capture.version,
            "seed": self.seed,
            "sampling": self.sampling,
            # A cube of more cases is another cube; of the other samplings it goes on.
            **({"cases": self.cases} if self.sampling == "latin_hypercube" else {}),
            "batch": self.batch,
            "ranges": {k: list(v) for k, v in self.ranges.items()},
            "fixed": dict(self.fixed),
            "success": {k: v for k, v in vars(self.success).items() if k != "latched" or v},
            "box": {k: list(v) for k, v in self.box.items()},
            "box_ends": self.box_ends,
        }


def load_study(path: str | Path) -> Study:
    """Read a study file; raises InputError with what is wrong, the value, what is allowed and the mend."""
    path = Path(path)
    raw = toml_table(path)
    known(path, "", raw, _KEYS)
    try:
        capture = find_capture(text(path, raw, "capture", ""))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    sampling = text(path, raw, "sampling", "adaptive")
    if sampling not in SAMPLINGS:
        raise InputError(f"{path}: sampling = {sampling!r}; allowed are {', '.join(SAMPLINGS)}")
    cases = count(path, raw.get("cases", 512), "cases", 1)
    if sampling == "adaptive" and cases > LARGEST:
        raise InputError(
            f"{path}: cases = {cases}; adaptive sampling takes at most {LARGEST}; give that, or sampling = 'sobol'"
        )
    ranges = _ranges(path, raw, "ranges", capture)
    if not ranges:
        raise InputError(f"{path}: [ranges] is empty; name at least one of {_names(capture)}")
    fixed = table(path, raw, "fixed")
    known(path, "fixed", fixed, [a.name for a in capture.axes])
    for name, value in fixed.items():
        axis, given = capture.axis(name), number(path, f"[fixed] {name}", value)
        if name in ranges:
            raise InputError(f"{path}: {name} stands in [ranges] and in [fixed]; keep one")
        if not axis.low <= given <= axis.high:
            raise InputError(f"{path}: [fixed] {name} = {value}; allowed is {axis.low:g} to {axis.high:g} {axis.unit}")
    box_table = dict(table(path, raw, "box"))
    box_cases = count(path, box_table.pop("cases", 60), "[box] cases", 1)
    box_ends = flag(path, box_table.pop("ends", False), "[box] ends")
    box = _ranges(path, {"box": box_table}, "box", capture)
    for name, (low, high) in box.items():
        if name not in ranges or low < ranges[name][0] or high > ranges[name][1]:
            raise InputError(f"{path}: [box] {name} = [{low:g}, {high:g}] is not within [ranges]; widen the range")
    return Study(
        path,
        text(path, raw, "name", path.stem),
        capture,
        count(path, raw.get("seed", 1), "seed", 0),
        sampling,
        count(path, raw.get("batch", 32), "batch", 1),
        cases,
        positive(path, "width", raw.get("width", 0.05)),
        ranges,
        {k: float(v) for k, v in fixed.items()},
        _success(path, raw),
        box,
        box_cases,
        box_ends,
        read_ways(path, raw, ranges),
    )


def _success(path: Path, raw: Mapping[str, Any]) -> Success:
    own = table(path, raw, "success")
    known(path, "success", own, _SUCCESS)
    numbers = {k: positive(path, f"[success] {k}", own[k]) for k in _SUCCESS[:2] if k in own}
    for key in _SUCCESS[:2]:
        if key not in numbers:
            raise InputError(f"{path}: [success] {key} is missing; say when a capture counts as one")
    return Success(**numbers, latched=flag(path, own.get("latched", False), "[success] latched"))


def _ranges(path: Path, raw: Mapping[str, Any], key: str, capture: Capture) -> dict[str, tuple[float, float]]:
    own, found = table(path, raw, key), {}
    known(path, key, own, [a.name for a in capture.axes])
    for name, value in own.items():
        axis = capture.axis(name)
        point = key == "box" and not isinstance(value, list)  # one value for all its cases
        pair = [value, value] if point else value
        if not (isinstance(pair, list) and len(pair) == 2):
            raise InputError(f"{path}: [{key}] {name} = {value!r}; allowed is [low, high] in {axis.unit}")
        low, high = (number(path, f"[{key}] {name}", v) for v in pair)
        if not low < high and not point:
            raise InputError(f"{path}: [{key}] {name} = [{low:g}, {high:g}] is empty; low must be below high")
        if low < axis.low or high > axis.high:
            allowed = f"{axis.low:g} to {axis.high:g} {axis.unit}"
            raise InputError(f"{path}: [{key}] {name} = [{low:g}, {high:g}]; the model holds for {allowed}")
        found[name] = (low, high)
    return found


def _names(capture: Capture) -> str:
    return ", ".join(a.name for a in capture.axes)
