"""How far off along single directions a capture still succeeds: from captures along each, nothing in between fitted.

From the nominal case outwards in eight equal steps to the range's limit, until one fails; that step is then halved
three times. An end is thus known to lie between a success and a failure that are a 64th of the way apart. It is the
first end that steps of an eighth see; behind it captures may succeed again. A study may ask for fewer axes, longer
steps and ends that are less exact (`Ways`); cases keep their numbers, so that it may ask for more later on.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from .study import Study
from .summary import Interval, nominal_point
from .ways import Ways

RADIAL = ("radial_y", "radial_z")
ANGLES = ("roll", "pitch", "yaw")
FINE = 64
"""The whole way in the smallest steps."""
STAGE = "ray"


@dataclass(frozen=True)
class Ray:
    """A straight way from the nominal case to the limit of the ranges.

    Parameters
    ----------
    axes : tuple of str
        Along which it goes.
    tip : array (n_ranges,)
        Its last point, on the limit.
    length : float
        From the nominal case to there, over those axes, signed where there is one [their unit].
    """

    axes: tuple[str, ...]
    tip: np.ndarray
    length: float


def rays(study: Study) -> list[Ray]:
    """Both ways along each axis that the study asks for, and along the diagonals of the two offsets where both do.

    Ways without length, of an axis whose nominal value is a limit of its range, are left out.
    """
    names, centre = list(study.ranges), nominal_point(study)
    low, high = np.array(list(study.ranges.values())).T
    wanted = (study.envelope or Ways()).axes or names
    directions = [sign * np.eye(len(names))[names.index(axis)] for axis in names for sign in (-1.0, 1.0)]
    directions = [d for d in directions if names[int(np.flatnonzero(d)[0])] in wanted]
    if set(RADIAL) <= set(wanted):
        y, z = (np.eye(len(names))[names.index(axis)] for axis in RADIAL)
        directions += [a * y + b * z for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    found = []
    for direction in directions:
        moved = np.flatnonzero(direction)
        reach = np.min(np.where(direction > 0, high - centre, centre - low)[moved])
        if reach > 0:
            length = reach * (np.sqrt(len(moved)) if len(moved) > 1 else direction[moved[0]])
            found.append(Ray(tuple(names[i] for i in moved), centre + reach * direction, float(length)))
    return found


def next_step(won: Mapping[int, bool], ways: Ways) -> int | None:
    """Which step of a ray is to be tried next, from those that were; None where its end is known."""
    low, high = last_and_first(won)
    if high is None:
        return min(low + FINE // ways.steps, FINE) if low < FINE else None
    return (low + high) // 2 if high - low > FINE // ways.exact else None


def most_cases(study: Study) -> int:
    """How many cases all rays take at most."""
    ways = study.envelope
    return 0 if ways is None else 1 + len(rays(study)) * (ways.steps + int(np.log2(ways.exact / ways.steps)))


def last_and_first(won: Mapping[int, bool]) -> tuple[int, int | None]:
    """The last success before the first failure, and that failure where there is one."""
    failures = [step for step, success in won.items() if not success]
    high = min(failures, default=None)
    return max((step for step, success in won.items() if success and (high is None or step < high)), default=0), high


def tried(table: pd.DataFrame, n_rays: int) -> list[dict[int, bool]]:
    """Which steps of each ray were tried, and whether they succeeded; the nominal case is step 0 of each."""
    found: list[dict[int, bool]] = [{} for _ in range(n_rays)]
    for number, margin in zip(table["case"].to_numpy(int), table["margin"].to_numpy(float), strict=True):
        for ray in range(n_rays) if number == 0 else [(number - 1) // FINE]:
            found[ray][0 if number == 0 else (number - 1) % FINE + 1] = bool(margin > 0)
    return found


def next_cases(study: Study, table: pd.DataFrame) -> dict[int, np.ndarray]:
    """Numbers and points (n_ranges,) of the cases that are to be run next; none where every end is known."""
    ways, centre = rays(study), nominal_point(study)
    won = tried(table, len(ways))
    if not won or 0 not in won[0]:
        return {0: centre}
    if not won[0][0]:
        return {}
    steps = {ray: next_step(w, study.envelope or Ways()) for ray, w in enumerate(won)}
    return {
        FINE * ray + step: centre + step / FINE * (ways[ray].tip - centre)
        for ray, step in steps.items()
        if step is not None
    }


def ends(study: Study, table: pd.DataFrame) -> list[tuple[Ray, Interval]]:
    """Each ray, and how far success goes along it: from the last success (low) to the first failure (high).

    Both are the range's limit where success goes at least so far, and NaN where the nominal case fails.
    """
    ways = rays(study)
    return [(ray, _end(ray, won)) for ray, won in zip(ways, tried(table, len(ways)), strict=True)]


def _end(ray: Ray, won: Mapping[int, bool]) -> Interval:
    if not won.get(0, False):
        return Interval(np.nan, np.nan, np.nan)
    low, high = last_and_first(won)
    outer = low if high is None else high
    return Interval(*(step / FINE * ray.length for step in (0.5 * (low + outer), low, outer)))


def envelope(study: Study, found: list[tuple[Ray, Interval]]) -> dict[str, tuple[Interval, Interval]]:
    """Between which values each axis that was tried may be, the others at nominal: nominal where that is its limit."""
    ways = {(ray.axes[0], ray.length > 0): end for ray, end in found if len(ray.axes) == 1}
    limits = {}
    tried = {axis for ray, _ in found for axis in ray.axes}
    for name, nominal in zip(study.ranges, nominal_point(study), strict=True):
        if name not in tried:
            continue
        down, up = (ways.get((name, upwards), Interval(0.0, 0.0, 0.0)) for upwards in (False, True))
        limits[name] = tuple(Interval(*(float(nominal + x) for x in vars(end).values())) for end in (down, up))
    return limits


def shortest(found: list[tuple[Ray, Interval]], axes: tuple[str, ...]) -> Interval | None:
    """Smallest end, without its sign, of the rays along some axes; None where there is no such ray."""
    sizes = [Interval(abs(e.value), abs(e.low), abs(e.high)) for ray, e in found if set(ray.axes) <= set(axes)]
    return min(sizes, key=lambda end: end.value) if sizes else None
