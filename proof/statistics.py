"""Intervals and calibration of counted figures."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta

CONFIDENCE = 0.95
RESAMPLES = 2000
BINS = 10


def clopper_pearson(right: int, count: int) -> tuple[float, float]:
    """Exact interval of a share, ``right`` of ``count`` (Clopper and Pearson 1934); (0, 1) where none was counted."""
    if count == 0:
        return 0.0, 1.0
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(beta.ppf(tail, right, count - right + 1)) if right else 0.0
    high = float(beta.ppf(1.0 - tail, right + 1, count - right)) if right < count else 1.0
    return low, high


def bootstrap(values: Sequence, statistic: Callable[[list], float]) -> tuple[float, float]:
    """Percentile interval of a statistic over resampled cases (Efron 1979), the same each time."""
    rng = np.random.default_rng(0)
    found = [statistic([values[i] for i in rng.integers(len(values), size=len(values))]) for _ in range(RESAMPLES)]
    low, high = np.quantile(found, [(1.0 - CONFIDENCE) / 2.0, (1.0 + CONFIDENCE) / 2.0])
    return float(low), float(high)


def calibration_error(probability: ArrayLike, right: ArrayLike) -> float:
    """Expected calibration error (Naeini, Cooper and Hauskrecht 2015): ten equal bins, |frequency − mean probability|
    weighted by how many fall into each.
    """
    return float(sum(abs(f - p) * n for p, f, n in reliability_bins(probability, right)) / np.size(probability))


def reliability_bins(probability: ArrayLike, right: ArrayLike) -> list[tuple[float, float, int]]:
    """(mean probability, frequency of being right, count) of each bin that is not empty."""
    p, y = np.asarray(probability, float), np.asarray(right, float)
    where: NDArray[np.int_] = np.minimum((p * BINS).astype(int), BINS - 1)
    return [
        (float(p[where == b].mean()), float(y[where == b].mean()), int(np.sum(where == b))) for b in np.unique(where)
    ]
