"""What the cases say: probabilities with exact intervals, and which axes matter."""

import warnings
from dataclasses import dataclass
from typing import Any

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


def proxy_beside(study: Study, table: pd.DataFrame) -> dict[str, Any]:
    """Of a study whose success is the latch: how often the radial error at the soft capture's end says otherwise.

    Keys: ``cases`` with a result, those that ``latched``, ``disagree`` of them, ``latched_against`` (it latched, and
    the proxy said no) and ``failed_against``, and ``ends``, the states in which failures ended with their numbers.
    """
    known = pd.DataFrame(table[table["reason"] == ""])
    near = known["radial_error"].to_numpy(float) < study.success.radial_error
    fine = near & known["enclosed"].to_numpy(bool) & (known["peak_tension"].to_numpy(float) < study.success.strength)
    latched = known["margin"].to_numpy(float) > 0
    ends = pd.Series(known["state"].to_numpy()[~latched], dtype=object).value_counts()
    return {
        "cases": len(known),
        "latched": int(np.sum(latched)),
        "disagree": int(np.sum(latched != fine)),
        "latched_against": int(np.sum(latched & ~fine)),
        "failed_against": int(np.sum(~latched & fine)),
        "ends": {str(state): int(count) for state, count in ends.items()},
    }


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
