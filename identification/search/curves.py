"""Nameless curves: what a channel's residual could run over where no effect has a name for it.

A curve is a sum of hat functions with its knots at even steps over the range that all recordings travel together.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.floating.tree import n_carriers
from ...models.rig.rig import Rig
from ..fitting.assembly import Evaluation
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]
Parts = list[Array]
"""One array an experiment."""

SMOOTH = 8
"""Knots of a smooth curve."""

TRAVEL = 24
"""Knots of a curve over a joint's travel, apart for either direction."""

FINE, LOCAL = 72, 16
"""Knots over the travel in fine steps, and how many next to one another make a place: a tooth, a dent in a track."""


def smooth_columns(experiments: Sequence[Experiment], states: Sequence[Evaluation], joint: int) -> Parts:
    """Smooth curves on one channel over position, speed, load and time together (n_band, k)."""
    motions = [e.motion for e in experiments]
    loads = [s.load[:, joint] for s in states]
    coordinates = ([m.q[:, joint] for m in motions], [m.qd[:, joint] for m in motions], loads, _elapsed(experiments))
    parts = zip(*(_hats(x, SMOOTH) for x in coordinates), strict=True)
    return [m.to_band(np.concatenate(own, axis=1)) for m, own in zip(motions, parts, strict=True)]


def nameless_columns(experiments: Sequence[Experiment], states: Sequence[Evaluation], joint: int) -> dict[str, Parts]:
    """Curves that no effect has a name for, on one channel, by the words for what they run over (n_band, k)."""
    tree, motions = experiments[0].body.tree, [e.motion for e in experiments]
    q, speeds = [m.q[:, joint] for m in motions], [m.qd[:, joint, None] for m in motions]
    found = {"position, speed, load and time together": smooth_columns(experiments, states, joint)}

    def enter(words: str, curves: Sequence[Array]) -> None:
        found[words] = [e.to_band(x, joint) for e, x in zip(experiments, curves, strict=True)]

    slow = _hats(_elapsed(experiments), SMOOTH)
    enter("speed, changing with time,", [s * v for s, v in zip(slow, speeds, strict=True)])
    travel = np.ptp(np.concatenate(q))
    if isinstance(tree, Rig) or n_carriers(tree) or not travel:
        return found  # on a suspension or a floating base every joint moves what carries the others
    fastest = max(float(np.max(np.abs(v))) for v in speeds)
    forth = [0.5 + 0.5 * np.tanh(v / (1e-2 * fastest)) for v in speeds]
    enter("direction, changing with time,", [s * (2 * f - 1) for s, f in zip(slow, forth, strict=True)])
    either = zip(forth, _hats(q, TRAVEL), strict=True)
    enter("position, apart for either direction,", [np.concatenate([f * x, (1 - f) * x], axis=1) for f, x in either])
    fine, unit = _hats(q, FINE), "m" if tree.joints[joint].kind == "prismatic" else "rad"
    lowest = min(float(x.min()) for x in q)
    for k in range(0, FINE - LOCAL + 1, LOCAL // 2):
        middle = lowest + travel * (k + (LOCAL - 1) / 2) / (FINE - 1)
        enter(f"position near {middle:.3g} {unit}", [x[:, k : k + LOCAL] for x in fine])
    for c, other in enumerate(motions[0].joints):
        own = [m.q[:, c] for m in motions]
        if c != joint and np.ptp(np.concatenate(own)):
            pairs = zip(_hats(own, SMOOTH), _hats([m.qd[:, c] for m in motions], SMOOTH), strict=True)
            enter(f"position and speed of {other}", [np.concatenate(pair, axis=1) for pair in pairs])
    return found


def _elapsed(experiments: Sequence[Experiment]) -> Parts:
    return [e.elapsed for e in experiments]


def _hats(coordinate: Sequence[Array], pieces: int) -> Parts:
    """Piecewise linear basis (n, k) over a coordinate, one array an experiment."""
    low, high = min(float(np.min(x)) for x in coordinate), max(float(np.max(x)) for x in coordinate)
    if not high > low:
        return [np.zeros((len(x), 0)) for x in coordinate]
    at = np.linspace(low, high, pieces)
    return [np.stack([np.interp(x, at, row) for row in np.eye(pieces)], axis=1) for x in coordinate]
