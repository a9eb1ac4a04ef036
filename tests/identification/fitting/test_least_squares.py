"""The bounded minimiser, against scipy's and against minima that are known."""

from typing import Any

import numpy as np
import pytest
import scipy.optimize

from snarelab.identification.fitting.least_squares import NormalEquations, Objective, _secant, bounded_step, minimise

INF = np.inf
reference: Any = scipy.optimize.least_squares


def normal(residual, jacobian):
    """Cost, gradient and normal matrix of an explicit residual, counted as calls."""

    def evaluate(theta):
        r, j = residual(theta), jacobian(theta)
        evaluate.seen.append(theta.copy())
        return NormalEquations(0.5 * float(r @ r), j.T @ r, j.T @ j)

    evaluate.seen = []
    return evaluate


def rosenbrock(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def rosenbrock_jacobian(x):
    return np.array([[-20 * x[0], 10.0], [-1.0, 0.0]])


TIME = np.linspace(0, 4, 60)


def decays(rng):
    """Two exponentials with noise: residual and Jacobian for (a, b, c, d) of a exp(-b t) + c exp(-d t)."""
    truth = np.array([rng.uniform(2, 5), rng.uniform(0.2, 0.6), rng.uniform(1, 3), rng.uniform(2, 4)])

    def curve(x):
        return x[0] * np.exp(-x[1] * TIME) + x[2] * np.exp(-x[3] * TIME)

    data = curve(truth) + 0.02 * rng.normal(size=len(TIME))

    def jacobian(x):
        e, f = np.exp(-x[1] * TIME), np.exp(-x[3] * TIME)
        return np.stack([e, -x[0] * TIME * e, f, -x[2] * TIME * f], 1)

    return truth, lambda x: curve(x) - data, jacobian


@pytest.mark.parametrize("start", [(-1.2, 1.0), (3.0, -4.0), (0.0, 0.0), (1.0, 1.0)])
def test_rosenbrock(start):
    found = minimise(
        Objective(normal(rosenbrock, rosenbrock_jacobian), np.full(2, -INF), np.full(2, INF)),
        np.array(start),
        max_steps=200,
    )
    assert found.settled
    np.testing.assert_allclose(found.theta, [1.0, 1.0], atol=1e-6)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((-2.0, -2.0), (0.5, 2.0)),  # the minimum on the valley's floor at x = 0.5
        ((-2.0, 1.5), (2.0, 3.0)),
        ((-2.0, -2.0), (2.0, 0.25)),
        ((1.2, -1.0), (2.0, 1.0)),  # in a corner
        ((0.3, 0.2), (0.4, 3.0)),
    ],
)
def test_rosenbrock_with_active_bounds(low, high):
    low, high = np.array(low), np.array(high)
    evaluate = normal(rosenbrock, rosenbrock_jacobian)
    found = minimise(Objective(evaluate, low, high), np.array([5.0, 5.0]), max_steps=300, tolerance=1e-12)
    # Brute force on a grid, then scipy's own polish: a global reference.
    x, y = np.meshgrid(np.linspace(low[0], high[0], 301), np.linspace(low[1], high[1], 301))
    k = np.argmin((10 * (y - x**2)) ** 2 + (1 - x) ** 2)
    start = np.clip([x.flat[k], y.flat[k]], low + 1e-9, high - 1e-9)
    wanted = reference(rosenbrock, start, rosenbrock_jacobian, bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert found.settled
    assert found.normal.cost == pytest.approx(wanted.cost, rel=1e-5)
    np.testing.assert_allclose(found.theta, wanted.x, atol=1e-4)
    for theta in evaluate.seen:
        assert np.all(theta >= low)
        assert np.all(theta <= high)


@pytest.mark.parametrize("seed", range(6))
def test_exponentials_as_scipy(seed):
    truth, residual, jacobian = decays(np.random.default_rng(seed))
    start, low, high = truth * 1.6, np.zeros(4), np.full(4, 10.0)
    found = minimise(Objective(normal(residual, jacobian), low, high), start, max_steps=200, tolerance=1e-13)
    wanted = reference(
        residual, start, jacobian, bounds=(low, high), x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13, max_nfev=2000
    )
    assert found.settled
    assert found.normal.cost == pytest.approx(wanted.cost, rel=1e-8)
    np.testing.assert_allclose(found.theta, wanted.x, rtol=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_exponentials_with_a_bound_in_the_way(seed):
    truth, residual, jacobian = decays(np.random.default_rng(seed))
    low, high = np.zeros(4), np.array([10.0, 10.0, 0.7 * truth[2], 0.8 * truth[3]])
    start = np.minimum(truth, 0.9 * high)
    evaluate = normal(residual, jacobian)
    found = minimise(Objective(evaluate, low, high), start, max_steps=300, tolerance=1e-13)
    wanted = reference(
        residual, start, jacobian, bounds=(low, high), x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13, max_nfev=5000
    )
    assert found.normal.cost <= wanted.cost * (1 + 1e-6)
    assert np.any(found.theta == high)  # on the bound itself, not near it
    assert all(np.all(theta <= high) for theta in evaluate.seen)


@pytest.mark.parametrize("seed", range(8))
def test_linear_problem_with_bounds_is_scipys_lsq_linear(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(40, 7)) * np.geomspace(1e-3, 1e3, 7), rng.normal(size=40)
    centre = np.linalg.lstsq(a, b, rcond=None)[0]
    width = np.abs(centre) * rng.uniform(0.1, 1.0, 7)
    low, high = centre - width * rng.choice([-0.5, 1.0], 7), centre + 3 * width
    found = minimise(
        Objective(normal(lambda x: a @ x - b, lambda x: a), low, high), rng.normal(size=7), tolerance=1e-13
    )
    wanted = scipy.optimize.lsq_linear(a, b, (low, high), method="bvls", tol=1e-14)
    assert found.normal.cost == pytest.approx(wanted.cost, rel=1e-7)
    np.testing.assert_allclose(found.theta, wanted.x, rtol=1e-3, atol=1e-4 * np.abs(wanted.x).max())


def test_an_infeasible_start_is_moved_inside():
    evaluate = normal(rosenbrock, rosenbrock_jacobian)
    low, high = np.array([0.0, 0.0]), np.array([2.0, 2.0])
    found = minimise(Objective(evaluate, low, high), np.array([-7.0, 9.0]), max_steps=200)
    np.testing.assert_array_equal(evaluate.seen[0], [0.0, 2.0])
    np.testing.assert_allclose(found.theta, [1.0, 1.0], atol=1e-6)


def test_rounding_never_leads_past_a_bound():
    rng = np.random.default_rng(0)
    for start, high in rng.uniform(0, 1, (500, 2)) * [-1.0, 0.1]:
        evaluate = normal(lambda x: x - 5.0, lambda x: np.ones((1, 1)))
        found = minimise(Objective(evaluate, np.array([-1.0]), np.array([high])), np.array([start]))
        assert max(float(theta[0]) for theta in evaluate.seen) <= high
        assert found.theta[0] == pytest.approx(high, rel=1e-14)


def test_a_parameter_pinned_between_equal_bounds_stays_there():
    evaluate = normal(rosenbrock, rosenbrock_jacobian)
    objective = Objective(evaluate, np.array([-9.0, 0.49]), np.array([9.0, 0.49]))
    found = minimise(objective, np.array([0.2, 0.0]), max_steps=200)
    assert all(theta[1] == 0.49 for theta in evaluate.seen)
    one = scipy.optimize.minimize_scalar(lambda x: np.sum(rosenbrock([x, 0.49]) ** 2), bounds=(0, 2), method="bounded")
    assert found.theta[0] == pytest.approx(one.x, abs=1e-4)  # pyright: ignore[reportAttributeAccessIssue]


def test_parameters_that_the_data_do_not_ask_for_do_no_harm():
    a = np.stack([TIME, TIME, 0 * TIME], 1)  # two alike, one that does nothing
    found = minimise(
        Objective(normal(lambda x: a @ x - 3 * TIME, lambda x: a), np.full(3, -INF), np.full(3, INF)),
        np.array([0.0, 0.0, 5.0]),
    )
    assert found.theta[:2].sum() == pytest.approx(3.0, abs=1e-5)
    assert found.theta[2] == 5.0


def test_where_the_model_cannot_be_evaluated_the_step_is_shortened():
    """log(x) is not defined below zero, and a full step from 3 goes there."""

    def evaluate(theta):
        if theta[0] <= 0:
            return NormalEquations(np.inf, np.full(1, np.nan), np.full((1, 1), np.nan))
        r, j = np.log(theta) + 1.0, 1 / theta
        return NormalEquations(0.5 * float(r @ r), j * r, np.diag(j**2))

    found = minimise(Objective(evaluate, np.full(1, -INF), np.full(1, INF)), np.array([3.0]))
    assert found.theta[0] == pytest.approx(np.exp(-1.0), abs=1e-6)


def test_running_out_of_steps_is_said():
    found = minimise(
        Objective(normal(rosenbrock, rosenbrock_jacobian), np.full(2, -INF), np.full(2, INF)),
        np.array([-1.2, 1.0]),
        max_steps=8,
    )
    assert not found.settled
    assert found.steps == 8
    assert found.normal.cost < 0.5 * np.sum(rosenbrock([-1.2, 1.0]) ** 2)


@pytest.mark.parametrize(
    ("scale", "damping", "low", "high", "wanted"),
    [
        # ½ (2x² + 2xy + 2y²) - 3x - 3y is least at (1, 1).
        ((1.0, 1.0), 0.0, (-9.0, -9.0), (9.0, 9.0), (1.0, 1.0)),
        ((1.0, 1.0), 0.0, (-9.0, -9.0), (0.5, 9.0), (0.5, 1.25)),  # y = (3 - x) / 2
        ((1.0, 1.0), 0.0, (2.0, -9.0), (9.0, 9.0), (2.0, 0.5)),
        ((1.0, 1.0), 0.0, (-9.0, -9.0), (0.5, 0.7), (0.5, 0.7)),
        ((1.0, 1.0), 3.0, (-9.0, -9.0), (9.0, 9.0), (0.5, 0.5)),  # 3 more on the diagonal: 6x = 3
        ((2.0, 1.0), 1.0, (-9.0, -9.0), (9.0, 9.0), (6 / 17, 15 / 17)),  # 4 and 1 more: 6x + y = 3 = x + 3y
        ((0.0, 1.0), 0.0, (-9.0, -9.0), (9.0, 9.0), (0.0, 1.5)),  # without influence it stays
        ((1.0, 1.0), 0.0, (0.0, -9.0), (0.0, 9.0), (0.0, 1.5)),  # without room, too
        ((0.0, 0.0), 0.0, (-9.0, -9.0), (9.0, 9.0), (0.0, 0.0)),
    ],
)
def test_a_step_is_the_bounded_minimum_of_the_damped_quadratic(scale, damping, low, high, wanted):
    here = NormalEquations(0.0, np.array([-3.0, -3.0]), np.array([[2.0, 1.0], [1.0, 2.0]]))
    found = bounded_step(here, np.array(scale), damping, np.array(low), np.array(high))
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_the_curvature_learnt_explains_the_last_step_and_is_sized_to_it():
    """Dennis, Gay and Welsch: afterwards it turns the step into what the normal matrix left of the gradient's change.
    Along the third axis, of which the step says nothing, it is scaled by |3| / |20|, what it predicted."""
    matrix, move, change = np.diag([1.0, 2.0, 5.0]), np.array([1.0, 1.0, 0.0]), np.array([4.0, 2.0, 0.0])
    for bend, third in ((np.zeros((3, 3)), 0.0), (10.0 * np.eye(3), 1.5), (0.1 * np.eye(3), 0.1)):
        found = _secant(bend, change, matrix, move)
        np.testing.assert_allclose(found @ move, [3.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(found, found.T, atol=1e-12)
        np.testing.assert_allclose(found[2], [0.0, 0.0, third], atol=1e-12)
    bend = np.eye(3)
    assert _secant(bend, -change, matrix, move) is bend  # the gradient fell along the step
    across = np.array([1.0, -1.0, 0.0])
    assert _secant(bend, across, matrix, move) is bend
