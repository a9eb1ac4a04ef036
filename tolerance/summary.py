"""What the cases say: probabilities with exact intervals, and which axes matter."""

import warnings
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import binomtest, sobol_indices, uniform

from .boundary import Boundary
from .study import Study


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


def sensitivities(study: Study, boundary: Boundary, samples: int = 2048) -> pd.DataFrame:
    """Sobol indices of the probability of success over the ranges, with bootstrap intervals.

    Columns ``first`` and ``total`` (Saltelli et al. 2010), each with ``_low`` and ``_high``; one row a varied axis.
    They are computed on the fitted boundary, not by further captures; zero where it has success, or failure,
    everywhere.
    """

    def probability(unit: np.ndarray) -> np.ndarray:
        return boundary.probability(unit.T)[None, :]

    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # there may be no variance to divide by
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
            name: np.nan_to_num(np.ravel(index)),
            f"{name}_low": np.nan_to_num(np.ravel(interval.low)),
            f"{name}_high": np.nan_to_num(np.ravel(interval.high)),
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
