"""The iteration that solves an interface: fixed points by hand, what it keeps, and when it gives up."""

import numpy as np
import pytest

from snarelab.cosim.iteration import ConvergenceError, Iteration, QuasiNewton
from snarelab.errors import InputError


def test_quasi_newton_solves_a_linear_interface_in_its_dimension_plus_two():
    rng = np.random.default_rng(3)
    matrix, shift = rng.normal(size=(4, 4)) * 3, rng.normal(size=4)
    found, count = QuasiNewton(Iteration(tolerance=1e-10)).solve(lambda y: matrix @ y + shift, np.zeros(4), np.ones(4))
    np.testing.assert_allclose(found, np.linalg.solve(np.eye(4) - matrix, shift), rtol=1e-8)
    assert count <= 6


def test_quasi_newton_remembers():
    solver = QuasiNewton(Iteration(tolerance=1e-10))
    matrix = np.array([[0.0, 5.0], [-4.0, 0.0]])
    _, first = solver.solve(lambda y: matrix @ y + 1.0, np.zeros(2), np.ones(2))
    _, second = solver.solve(lambda y: matrix @ y + 2.0, np.zeros(2), np.ones(2))
    assert second < first


def test_quasi_newton_says_when_there_is_no_solution():
    with pytest.raises(ConvergenceError):
        QuasiNewton(Iteration(limit=10)).solve(lambda y: y + 1.0, np.zeros(1), np.ones(1))


@pytest.mark.parametrize(
    ("options", "allowed"),
    [
        ({"limit": 2}, True),
        ({"limit": 1}, False),
        ({"tolerance": 1e-300}, True),
        ({"tolerance": 0.0}, False),
        ({"tolerance": -1.0}, False),
        ({"tolerance": float("nan")}, False),
    ],
)
def test_an_iteration_that_could_never_end_is_refused(options, allowed):
    if allowed:
        Iteration(**options)
    else:
        with pytest.raises(InputError, match="must be positive and limit"):
            Iteration(**options)


@pytest.mark.parametrize(("scale", "count"), [(1.0, 1), (0.99, 2)])
def test_a_residual_is_measured_by_the_scale_and_the_tolerance_is_enough(scale, count):
    """y = 0.5 from 0: a residual of 0.5 is as much as is allowed, of 0.5/0.99 too much."""
    found, calls = QuasiNewton(Iteration(tolerance=0.5)).solve(
        lambda _: np.array([0.5]), np.zeros(1), np.array([scale])
    )
    assert (found, calls) == (pytest.approx([0.5]), count)


def test_two_evaluations_give_a_line_and_its_fixed_point():
    """y = 3 y + 2 from 0: 2, then 8; the line through residuals 2 and 6 is zero at y = -1."""
    asked = []

    def line(y):
        asked.append(float(y[0]))
        return 3.0 * y + 2.0

    QuasiNewton(Iteration()).solve(line, np.zeros(1), np.ones(1))
    assert asked == pytest.approx([0.0, 2.0, -1.0])


def test_an_iteration_ends_with_its_limit_and_says_how_far_off_it_was():
    calls = []

    def never(y):
        calls.append(y)
        return y + 2.0

    solver = QuasiNewton(Iteration(limit=3))
    with pytest.raises(ConvergenceError, match=r"residual 5\.0e-01 of the values' magnitude after 3 evaluations"):
        solver.solve(never, np.zeros(1), np.array([4.0]))
    assert len(calls) == 3
    assert solver._residuals == solver._results == []  # what was learnt on the way led nowhere


def test_an_iteration_stops_at_what_is_no_number():
    calls = []

    def bad(y):
        calls.append(y)
        return np.array([np.nan])

    with pytest.raises(ConvergenceError, match="after 1 evaluations"):
        QuasiNewton(Iteration()).solve(bad, np.zeros(1), np.ones(1))
    assert len(calls) == 1


def test_of_many_differences_the_newest_are_kept():
    """Three values without coupling: more differences come up than the two that stay."""
    solver = QuasiNewton(Iteration(kept=2, limit=60, tolerance=1e-6))
    shift = np.arange(1.0, 4.0)
    matrix = np.diag([0.5, 0.3, 0.2])
    found, _ = solver.solve(lambda y: matrix @ y + shift, np.zeros(3), np.ones(3))
    assert found == pytest.approx(shift / np.array([0.5, 0.7, 0.8]), rel=1e-5)
    assert len(solver._residuals) == len(solver._results) == 2
    solver.forget()
    assert solver._residuals == solver._results == []


def test_a_result_is_corrected_by_the_differences_that_cancel_its_residual():
    """Residuals differ by (2, 0) where results differ by (6, 1): of a residual (1, 5) half of it is taken off."""
    solver = QuasiNewton(Iteration())
    assert solver._correction(np.array([1.0, 5.0])) == 0.0
    solver._residuals, solver._results = [np.array([2.0, 0.0])], [np.array([6.0, 1.0])]
    np.testing.assert_allclose(solver._correction(np.array([1.0, 5.0])), [-3.0, -0.5], rtol=1e-12)
