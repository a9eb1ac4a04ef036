"""Blocks of time of a recording: longer than what its residual remembers."""

import numpy as np
from numpy.typing import NDArray

from ..deciding import BLOCK
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]

FEWEST_BLOCKS = 4


def blocks(e: Experiment, x: Array) -> Array:
    """Sums over blocks of time."""
    return np.array(
        [part.sum() for part in np.array_split(x, max(int(len(x) / (2 * e.motion.band) / BLOCK), FEWEST_BLOCKS))]
    )
