"""What the cases say: probabilities with exact intervals, the envelope of each axis, and which axes matter."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import binomtest, sobol_indices, uniform

from .boundary import UNDECIDED, Boundary
from .study import Study

_STEPS = 400


@dataclass(frozen=True)
class Interval:
    """A number with its interval.

    Parameters
    ----------
    value, low, high : float
    """

    value: float
    low: float
    high: float


def success_probability(table: pd.DataFrame, confidence: float = 0.95) -> Interval:
    """Share of successful cases with the exact binomial interval (Clopper & Pearson 1934)."""
    won, total = int(np.sum(table["margin"].to_numpy(float) > 0)), len(table)
    interval = binomtest(won, total).proportion_ci(confidence, method="exact")
    return Interval(won / total, float(interval.low), float(interval.high))


def envelopes(study: Study, boundary: Boundary) -> dict[str, tuple[Interval, Interval]]:
    """How far each varied axis may go down and up from nominal, the other axes at nominal, before success ends.

    Each end is where the probability of success falls below one half; its interval runs from where it leaves 95 % to
    where it reaches 5 %. An end at the range's limit says that success goes at least so far. NaN where the nominal case
    itself is no success.
    """
    centre = nominal_point(study)
    ends = {}
    for i, name in enumerate(study.ranges):
        direction = np.zeros(len(centre))
        direction[i] = 1.0
        ends[name] = tuple(_reach(study, boundary, centre, sign * direction) for sign in (-1.0, 1.0))
    return ends


def worst_reach(study: Study, boundary: Boundary, axes: tuple[str, ...], directions: int = 256) -> Interval:
    """Smallest misalignment, over all directions in the space of some axes of one unit, at which success ends."""
    centre, columns = nominal_point(study), [list(study.ranges).index(a) for a in axes]
    rays = np.random.default_rng(0).normal(size=(directions, len(axes)))
    found = []
    for ray in rays / np.linalg.norm(rays, axis=1, keepdims=True):
        direction = np.zeros(len(centre))
        direction[columns] = ray
        found.append(_reach(study, boundary, centre, direction))
    signless = [Interval(abs(f.value), abs(f.low), abs(f.high)) for f in found]
    return Interval(*(float(np.min([getattr(f, k) for f in signless])) for k in ("value", "low", "high")))


def sensitivities(study: Study, boundary: Boundary, samples: int = 4096) -> pd.DataFrame:
    """Sobol indices of the probability of success over the ranges, with bootstrap intervals.

    Columns ``first`` and ``total`` (Saltelli et al. 2010), each with ``_low`` and ``_high``; one row a varied axis.
    They are computed on the fitted boundary, not by further captures.
    """

    def probability(unit: np.ndarray) -> np.ndarray:
        return boundary.probability(unit.T)[None, :]

    found = sobol_indices(
        func=probability, n=samples, dists=[uniform()] * len(study.ranges), rng=np.random.default_rng(study.seed)
    )
    spread = found.bootstrap(confidence_level=0.95, n_resamples=200)
    columns = {}
    for name, index, interval in (
        ("first", found.first_order, spread.first_order.confidence_interval),
        ("total", found.total_order, spread.total_order.confidence_interval),
    ):
        columns |= {
            name: np.ravel(index),
            f"{name}_low": np.ravel(interval.low),
            f"{name}_high": np.ravel(interval.high),
        }
    return pd.DataFrame(columns, index=pd.Index(list(study.ranges), name="axis"))


def to_unit(study: Study, points: np.ndarray) -> np.ndarray:
    """Values of the varied axes, shape (n, n_ranges), as points of the unit cube."""
    low, high = np.array(list(study.ranges.values())).T
    return (points - low) / (high - low)


def nominal_point(study: Study) -> np.ndarray:
    """The nominal case, or the nearest to it within the ranges."""
    values = {a.name: a.nominal for a in study.capture.axes}
    return np.array([np.clip(values[n], low, high) for n, (low, high) in study.ranges.items()])


def _reach(study: Study, boundary: Boundary, centre: np.ndarray, direction: np.ndarray) -> Interval:
    """Signed distance from ``centre`` along ``direction`` to the three levels of probability."""
    low, high = np.array(list(study.ranges.values())).T
    with np.errstate(divide="ignore", invalid="ignore"):
        limits = np.where(
            direction > 0, (high - centre) / direction, np.where(direction < 0, (low - centre) / direction, np.inf)
        )
    distance = np.linspace(0.0, float(np.min(limits)), _STEPS)
    p = boundary.probability(to_unit(study, np.clip(centre + distance[:, None] * direction, low, high)))
    sign = -1.0 if np.sum(direction) < 0 and np.count_nonzero(direction) == 1 else 1.0
    ends: Mapping[float, float] = {level: sign * _first_below(distance, p, level) for level in (*UNDECIDED, 0.5)}
    return Interval(ends[0.5], ends[UNDECIDED[1]], ends[UNDECIDED[0]])


def _first_below(distance: np.ndarray, p: np.ndarray, level: float) -> float:
    below = np.flatnonzero(p < level)
    if below.size == 0:
        return float(distance[-1])
    return float(distance[below[0]]) if below[0] > 0 else float("nan")
