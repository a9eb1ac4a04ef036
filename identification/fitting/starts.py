"""Where to start a law that is nonlinear in its shape parameters, and how many starts agree on the best end.

Given the shapes, a model is linear in its amplitudes, so a point on the grid of shapes costs one pass over the samples.
The grid of every effect is gone through so; its local minima are the first starts. Then come the ends with two shapes
of one law exchanged, since terms of a kind, as Makkar friction has them, can swap roles; then points drawn at random,
until the best cost has been reached three times.
"""

from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from .problem import Problem
from .projection import project

Array = NDArray[np.float64]

AGREE = 3
"""Starts that must reach the best cost before no more are tried."""

MOST_STARTS = 10

SAME = 1e-3
"""Relative difference of two costs that counts as none."""


def best_start(problem: Problem, theta: Array, sigma: Array, rng: np.random.Generator) -> tuple[Array, int, int]:
    """Try starts from everywhere in the shapes' grids.

    Parameters
    ----------
    problem : Problem
        P parameters, c channels.
    theta : array (P,)
        One more start, and the amplitudes to begin with.
    sigma : array (c,)
        Channels are weighted by 1 / sigma.
    rng : numpy.random.Generator
        Of the random starts.

    Returns
    -------
    theta : array (P,)
        Best end; what was given where there are no shape parameters.
    tried, reached : int
        Starts, and how many of them reached the best cost.
    """
    if not problem.grids:
        return theta, 1, 1
    pending = grid_starts(problem, theta, sigma)
    ends: list[Array] = []
    costs: list[float] = []
    reached = 0
    while len(ends) < MOST_STARTS and reached < AGREE:
        start = pending.pop(0) if pending else _random_start(problem, ends[int(np.argmin(costs))], sigma, rng)
        end = problem.minimise(start, sigma, tolerance=1e-5)
        if all(abs(end.normal.cost - cost) > SAME * cost for cost in costs):
            pending += _exchanged(problem, end.theta, sigma)
        ends.append(end.theta)
        costs.append(end.normal.cost)
        reached = int(np.count_nonzero(np.array(costs) <= (1 + SAME) * min(costs)))
    return ends[int(np.argmin(costs))], len(ends), reached


def grid_starts(problem: Problem, theta: Array, sigma: Array) -> list[Array]:
    """Best grid point, one effect after the other; then ``theta`` and the grids' other local minima, best first."""
    others = [_projected(problem, theta, sigma, {})]
    best = theta
    for grids in problem.grids:
        counts = tuple(len(grid) for _, grid in grids)
        costs, points = np.empty(counts), np.empty((*counts, len(theta)))
        for k in product(*map(range, counts)):
            shape = {position: float(grid[i]) for (position, grid), i in zip(grids, k, strict=True)}
            costs[k], points[k] = _projected(problem, best, sigma, shape)
        lowest = np.unravel_index(np.argmin(costs), counts)
        others += [(float(costs[k]), points[k]) for k in np.ndindex(counts) if k != lowest and _is_minimum(costs, k)]
        best = points[lowest]
    others.sort(key=lambda item: item[0])
    return [best, *(point for _, point in others)]


def _is_minimum(costs: Array, k: tuple[int, ...]) -> bool:
    """Whether no neighbour on the grid, diagonal ones included, is lower."""
    around = tuple(slice(max(0, i - 1), i + 2) for i in k)
    return bool(np.isfinite(costs[k]) and costs[k] <= costs[around].min())


def _exchanged(problem: Problem, theta: Array, sigma: Array) -> list[Array]:
    """Starts with two shapes of one effect exchanged that have a unit in common; of its other shapes, the best."""
    found = []
    for grids in problem.grids:
        for one, other in combinations([position for position, _ in grids], 2):
            if problem.assembly.slots[one].unit == problem.assembly.slots[other].unit:
                values = {position: (theta[position], *grid) for position, grid in grids}
                values |= {one: (theta[other],), other: (theta[one],)}
                shapes = [dict(zip(values, map(float, point), strict=True)) for point in product(*values.values())]
                found.append(min((_projected(problem, theta, sigma, s) for s in shapes), key=lambda end: end[0])[1])
    return found


def _random_start(problem: Problem, theta: Array, sigma: Array, rng: np.random.Generator) -> Array:
    """A start with every shape parameter drawn from its grid's range, evenly in its logarithm."""
    shape = {}
    for position, grid in (pair for grids in problem.grids for pair in grids):
        low, high = float(np.min(grid)), float(np.max(grid))
        shape[position] = low if low == high else float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return _projected(problem, theta, sigma, shape)[1]


def _projected(problem: Problem, theta: Array, sigma: Array, shape: dict[int, float]) -> tuple[float, Array]:
    """Cost and parameters (P,) with some shapes set, the others held, and all amplitudes solved."""
    trial = theta.copy()
    trial[list(shape)] = list(shape.values())
    trial = np.clip(trial, problem.assembly.low, problem.assembly.high)
    moved, cost, _ = project(problem.objective(sigma), trial, problem.shapes)
    return cost, moved
