"""The smallest effect that recordings would have shown."""

import numpy as np

from ..evidence.members import log_bayes
from ..evidence.search import Search
from .source import GridPoint


def smallest(made: Search, h: int) -> dict[str, float]:
    """The value of each amplitude from which on the name would have had a posterior above a half, shapes as they are
    at the first point of the grid. Of a law without amplitudes, where it does least on its grid: it grows with a first
    parameter that is zero where there is no effect, and else with one over it."""
    x, start = made.pool[h], sum(len(y.items) for y in made.pool[:h])
    k = 0
    if x.items[0].whole:
        k = min((k for k, item in enumerate(x.items) if item.whole), key=lambda k: x.items[k].label.size)
    item, curvature, found = x.items[k], made.on.own(start + k), {}
    v: GridPoint = item.label
    spread = np.full(1, 1 / v.size) if item.whole else item.spread
    t = np.geomspace(1e-4, 1e2, 400)
    first = v.placed.effect.parameters[0]
    for k, key in enumerate(v.amplitudes or [f"{v.placed.key}.{first.name}"]):
        h_of_one = curvature[k : k + 1, k : k + 1] * (spread[k] / item.spread[k]) ** 2
        many = np.broadcast_to(h_of_one, (len(t), 1, 1))
        gain = log_bayes(many, h_of_one[0] * t[:, None], np.tile(item.positive[k : k + 1], (len(t), 1))).max(axis=1)
        enough = np.flatnonzero(gain + x.prior > 0)
        if len(enough):
            size = v.origin.get(key, 0.0) + float(t[enough[0]] * spread[k])
            if item.whole:
                size = v.values[key] / size if first.zero or v.inverse else v.values[key] * size
            found[key.rpartition(".")[2]] = size
    return found
