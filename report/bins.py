"""Mean and scatter of samples in bins of a coordinate."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BINS = 40
FEWEST = 8
"""Samples that a bin needs to say something."""


def binned(coordinate: Array, residual: Array, bins: int = BINS) -> tuple[Array, Array, Array]:
    """Bin centres, mean and standard deviation of the residual in bins of equal width, each (n_bins,).

    Where the coordinate changes sign zero is an edge, so that a jump there is not smeared. Bins with fewer than eight
    samples are NaN.
    """
    low, high = float(coordinate.min()), float(coordinate.max())
    width = (high - low) / bins
    first = np.floor(low / width) if low < 0 < high else low / width
    edges = width * (first + np.arange(bins + 2))
    index = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, bins)
    count = np.bincount(index, minlength=bins + 1)
    enough = count >= FEWEST
    count = np.where(enough, count, 1)
    mean = np.bincount(index, residual, bins + 1) / count
    spread = np.bincount(index, (residual - mean[index]) ** 2, bins + 1) / count
    centres = 0.5 * (edges[1:] + edges[:-1])
    return centres, np.where(enough, mean, np.nan), np.where(enough, np.sqrt(spread), np.nan)
