"""Smooth curves over which a channel's residual may run.

A curve is a sum of hat functions with its knots at even steps over the range that all recordings travel together.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..fitting.assembly import TorqueEvaluation
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]
Parts = list[Array]
"""One array an experiment."""

SMOOTH = 8
"""Knots of a smooth curve."""


def smooth_columns(experiments: Sequence[Experiment], states: Sequence[TorqueEvaluation], joint: int) -> Parts:
    """Smooth curves on one channel over position, speed, load and time together (n_band, k)."""
    motions = [e.motion for e in experiments]
    loads = [s.load[:, joint] for s in states]
    coordinates = (
        [m.q[:, joint] for m in motions],
        [m.qd[:, joint] for m in motions],
        loads,
        [e.elapsed for e in experiments],
    )
    parts = zip(*(_hats(x, SMOOTH) for x in coordinates), strict=True)
    return [m.to_band(np.concatenate(own, axis=1)) for m, own in zip(motions, parts, strict=True)]


def _hats(coordinate: Sequence[Array], pieces: int) -> Parts:
    """Piecewise linear basis (n, k) over a coordinate, one array an experiment."""
    low, high = min(float(np.min(x)) for x in coordinate), max(float(np.max(x)) for x in coordinate)
    if not high > low:
        return [np.zeros((len(x), 0)) for x in coordinate]
    at = np.linspace(low, high, pieces)
    return [np.stack([np.interp(x, at, row) for row in np.eye(pieces)], axis=1) for x in coordinate]
