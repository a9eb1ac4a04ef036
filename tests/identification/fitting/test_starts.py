"""Starts of a nonlinear fit: local minima of a grid by hand, their order, and when enough starts agree."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.fitting import starts
from snarelab.identification.fitting.least_squares import NormalEquations, Objective
from snarelab.identification.fitting.starts import _is_minimum, _projected, _random_start, best_start, grid_starts

SIGMA = np.ones(1)


@pytest.mark.parametrize(
    ("costs", "minima"),
    [
        ([3, 1, 2, 2, 4], [1, 3]),  # of 2, 2 the first has a lower neighbour, the second its equal and a higher one
        ([1, 2, 3], [0]),
        ([3, 2, 1], [2]),
        ([5, 1, 5, 0, 5], [1, 3]),
        ([np.inf, np.inf, 2, np.inf], [2]),
        ([7], [0]),
    ],
)
def test_minima_of_a_row(costs, minima):
    assert [k for k in range(len(costs)) if _is_minimum(np.array(costs, float), (k,))] == minima


def test_minima_of_a_grid_look_over_the_corners_too():
    costs = np.array([[5, 5, 5, 5], [5, 2, 5, 5], [5, 5, 1, 5], [3, 5, 5, 5]], float)
    found = [k for k in np.ndindex(4, 4) if _is_minimum(costs, k)]
    assert found == [(0, 3), (2, 2), (3, 0)]  # 2 stands next to 1 over a corner; the 5 has only fives about it


def tables(monkeypatch, *costs):
    """Problem of one shape parameter an effect, whose cost is a sum of tables over its grid; calls are recorded."""
    grids = [[(position, np.arange(1.0, 1 + len(c)))] for position, c in enumerate(costs)]
    calls: list[Any] = []

    def projected(_problem: Any, theta: Any, _sigma: Any, shape: Any) -> Any:
        calls.append(dict(shape))
        moved = theta.copy()
        moved[list(shape)] = list(shape.values())
        total = sum(c[int(x) - 1] for c, x in zip(costs, moved, strict=True))
        return float(total), moved

    monkeypatch.setattr(starts, "_projected", projected)
    problem: Any = Made(grids=grids)
    return problem, calls


def test_the_best_of_one_grid_comes_first_then_what_was_given_and_the_other_minima_by_their_cost(monkeypatch):
    """Minima of the table at 2 (cost 1), 4 (cost 3) and 6 (cost 2); what was given, at 3, costs 9."""
    problem, _ = tables(monkeypatch, [8.0, 1.0, 9.0, 3.0, 7.0, 2.0])
    found = grid_starts(problem, np.array([3.0]), SIGMA)
    assert [float(x[0]) for x in found] == [2.0, 6.0, 4.0, 3.0]


def test_one_effects_grid_after_the_other_from_the_best_so_far(monkeypatch):
    """The first is at 2 when the second is gone through, and both minima of either are starts."""
    problem, calls = tables(monkeypatch, [5.0, 1.0, 4.0], [3.0, 6.0, 2.0])
    found = grid_starts(problem, np.array([3.0, 2.0]), SIGMA)
    # Costs: best 1 + 2; second grid's other minimum 1 + 3; given 4 + 6.
    assert [x.tolist() for x in found] == [[2.0, 3.0], [2.0, 1.0], [3.0, 2.0]]
    assert calls == [{}, *({0: k} for k in (1.0, 2.0, 3.0)), *({1: k} for k in (1.0, 2.0, 3.0))]


def test_every_pair_of_two_shapes_of_one_effect_is_tried(monkeypatch):
    problem, calls = tables(monkeypatch, [1.0, 0.0], [0.0, 2.0, 3.0])
    problem.grids = [[(0, np.array([1.0, 2.0])), (1, np.array([1.0, 2.0, 3.0]))]]
    first, given = grid_starts(problem, np.array([1.0, 3.0]), SIGMA)
    assert first.tolist() == [2.0, 1.0]
    assert given.tolist() == [1.0, 3.0]
    assert len(calls) == 1 + 2 * 3


class Searched:
    """Ends of a row of searches, by their cost; where each began is kept."""

    def __init__(self, costs):
        self.grids, self.costs, self.began, self.tolerances = [[(0, np.array([1.0, 4.0]))]], list(costs), [], []

    def minimise(self, start, _sigma, tolerance):
        self.began.append(float(start[0]))
        self.tolerances.append(tolerance)
        k = len(self.began) - 1
        return Made(theta=np.array([100.0 + k]), normal=Made(cost=self.costs[k]))


@pytest.mark.parametrize(
    ("costs", "tried", "reached", "best"),
    [
        ([5, 5, 5], 3, 3, 0),
        ([0, 0, 0], 3, 3, 0),
        ([5, 7, 5, 6, 5], 5, 3, 0),
        ([5, 5, 3, 3, 3], 5, 3, 2),  # those that were best before no longer count
        ([1.0, 1.0009, 1.0009], 3, 3, 0),  # a thousandth is none
        ([1.0, 1.0011, 1.0009, 1.0009], 4, 3, 0),
        ([9, 8, 7, 6, 5, 4, 3, 2, 1, 1], 10, 2, 8),  # ten at most
    ],
)
def test_starts_go_on_until_three_reach_the_best_cost(monkeypatch, costs, tried, reached, best):
    problem: Any = Searched(costs)
    monkeypatch.setattr(starts, "grid_starts", lambda *_: [np.array([1.0]), np.array([2.0])])
    monkeypatch.setattr(starts, "_random_start", lambda _p, theta, *_: theta + 1000.0)
    found = best_start(problem, np.zeros(1), SIGMA, np.random.default_rng(0))
    assert (found[0][0], *found[1:]) == (100.0 + best, tried, reached)
    assert problem.began[:2] == [1.0, 2.0]
    # Drawn from the best end so far, once the grid has no more.
    ends = [1100.0 + int(np.argmin(costs[:k])) for k in range(2, tried)]
    assert problem.began[2:] == ends
    assert set(problem.tolerances) == {1e-5}


def test_without_shapes_the_start_is_what_was_given():
    theta = np.array([3.0])
    problem: Any = Made(grids=[])
    assert best_start(problem, theta, SIGMA, np.random.default_rng(0)) == (theta, 1, 1)


def test_a_random_shape_lies_in_its_grids_range_evenly_in_its_logarithm(monkeypatch):
    """Halfway of 2 to 32 is 8; the second grid has one point alone."""
    seen = []
    monkeypatch.setattr(starts, "_projected", lambda _p, theta, _s, shape: (0.0, seen.append(shape) or theta))
    problem: Any = Made(grids=[[(1, np.array([32.0, 2.0]))], [(0, np.array([5.0]))]])
    halfway: Any = Made(uniform=lambda a, b: (a + b) / 2)
    _random_start(problem, np.zeros(2), SIGMA, halfway)
    assert seen == [pytest.approx({1: 8.0, 0: 5.0})]
    rng = np.random.default_rng(0)
    for _ in range(400):
        _random_start(problem, np.zeros(2), SIGMA, rng)
    drawn = np.log2([s[1] for s in seen[1:]])
    assert (drawn.min(), drawn.max()) == pytest.approx((1.0, 5.0), abs=0.1)
    assert drawn.mean() == pytest.approx(3.0, abs=0.2)  # 4 / sqrt(12 * 400) is 0.06


def test_amplitudes_are_solved_for_a_shape_between_bounds():
    """y = a x^s: at s = 2 on x = 1, 2, 3 the best a is 1·1 + 4·2 + 9·3 over 1 + 16 + 81, 36/98, for y = x."""
    x = np.array([1.0, 2.0, 3.0])

    def normal(theta):
        s, a = theta
        r, columns = x - a * x**s, -np.stack([a * np.log(x) * x**s, x**s], 1)
        return NormalEquations(0.5 * float(r @ r), columns.T @ r, columns.T @ columns)

    def problem(high):
        objective = Objective(normal, np.array([0.0, 0.0]), np.array([3.0, high]))
        assembly = Made(low=objective.low, high=objective.high)
        return Made(assembly=assembly, objective=lambda _sigma: objective, shapes=np.array([True, False]))

    free: Any = problem(np.inf)
    begin = np.array([1.0, 0.5])
    cost, found = _projected(free, begin, SIGMA, {0: 2.0})
    np.testing.assert_allclose(found, [2.0, 36 / 98], rtol=1e-6)
    assert cost == pytest.approx(0.5 * (14 - 36**2 / 98), rel=1e-6)
    np.testing.assert_array_equal(begin, [1.0, 0.5])
    _, found = _projected(free, begin, SIGMA, {0: 7.0})  # the bound is 3: 1 + 16 + 81 over 1 + 64 + 729
    np.testing.assert_allclose(found, [3.0, 98 / 794], rtol=1e-6)
    bounded: Any = problem(0.2)
    cost, found = _projected(bounded, np.array([1.0, 0.1]), SIGMA, {0: 2.0})
    np.testing.assert_allclose(found, [2.0, 0.2], rtol=1e-6)
    assert cost == pytest.approx(0.5 * np.sum((x - 0.2 * x**2) ** 2), rel=1e-6)
