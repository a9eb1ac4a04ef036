"""Fits of a capture's effects where simulations are straight lines: steps, derivatives and spreads by hand."""

from dataclasses import replace

import numpy as np
import pytest
from captures_by_hand import CLEARANCE, FRICTION, PRETENSION, UMBILICAL, Straight, along, captures_of, fit_of

from snarelab.identification.snare.fit import (
    _broyden,
    evaluate,
    fit,
    normal,
    spread,
    started,
    step_from,
    with_slopes,
)

COURSE = along(*(np.where(np.arange(16) % 2, 1.0, -1.0)))
"""[m] For each unit of friction, 16 quarters back and forth along x: 48 numbers, of which 16 move."""
OTHER = along(*((0.0, 0.01 * k, 0.0) for k in range(16)))
"""[m] For each newton of pretension, along y, which friction does not move."""
FLOOR = np.hypot(1.5e-4, 1e-4 / np.sqrt(5))
"""[m] Least that a position counts for, with noise of 0.1 mm."""


def height(*squares):
    """L of the 48 numbers with these squares: -1/2 · 48/4 · ln(sum/48 + f²)."""
    return -6 * np.log(sum(squares) / 48 + FLOOR**2)


def of_friction(truth=0.3, **options):
    runs = Straight({FRICTION: COURSE}, **options)
    return runs, captures_of(runs, truth * COURSE)


def asked(runs):
    return [x[0] for x in runs.asked]


def test_what_is_left_and_its_likelihood_are_those_of_the_simulation_at_each_place():
    runs, captures = of_friction(fails=lambda x: x[FRICTION] > 1.0)
    near, far, failed = evaluate(captures, [FRICTION], [np.array([x]) for x in (0.2, 0.7, 1.1)])
    assert asked(runs) == pytest.approx([0.2, 0.7, 1.1])
    np.testing.assert_allclose(near.residuals[0]["position"], 0.1 * COURSE[::5], atol=1e-12)
    np.testing.assert_allclose(far.residuals[0]["position"], -0.4 * COURSE[::5], atol=1e-12)
    assert near.likelihood == pytest.approx(height(16 * 0.01), rel=1e-9)
    assert far.likelihood == pytest.approx(height(16 * 0.16), rel=1e-9)
    assert near.values == {"contact_friction.pin.coefficient": pytest.approx(0.2)}
    assert failed.likelihood == -np.inf
    assert (failed.tracks, failed.residuals) == ((), ())


def test_a_simulation_that_is_not_finite_somewhere_has_failed():
    _, captures = of_friction(law=lambda x: np.nan if x > 0.5 else x)
    good, bad = evaluate(captures, [FRICTION], [np.array([0.5]), np.array([0.6])])
    assert np.isfinite(good.likelihood)
    assert bad.likelihood == -np.inf


def test_a_start_is_brought_inside_the_bounds_but_for_what_is_held():
    runs, captures = of_friction()
    assert started(captures, [FRICTION], np.array([2.0])).x == pytest.approx([1.5])
    assert started(captures, [FRICTION], np.array([-0.1])).x == pytest.approx([0.0])
    held = replace(FRICTION, hold=("coefficient",))
    runs.courses = {held: COURSE}
    assert started(captures, [held], np.array([2.0])).x == pytest.approx([2.0])


@pytest.mark.parametrize(("x", "end"), [(0.2, 0.23), (1.45, 1.48), (1.48, 1.45)])
def test_derivatives_are_differences_of_one_step_away_from_the_upper_bound(x, end):
    """The residual falls by the course for each unit, whichever way it is taken; the bound is 1.5, a step 0.03."""
    runs, captures = of_friction()
    at = with_slopes(captures, evaluate(captures, [FRICTION], [np.array([x])])[0])
    assert asked(runs) == pytest.approx([x, end])
    assert at.slopes is not None
    np.testing.assert_allclose(at.slopes[0][0]["position"], -COURSE[::5], atol=1e-9)


def test_a_derivative_is_nothing_where_the_end_of_its_difference_cannot_be_simulated():
    _, captures = of_friction(fails=lambda x: x[FRICTION] > 0.2)
    at = with_slopes(captures, evaluate(captures, [FRICTION], [np.array([0.2])])[0])
    assert at.slopes is not None
    np.testing.assert_array_equal(at.slopes[0][0]["position"], np.zeros((16, 3)))


def of_two(x, truth=(0.3, 50.0), held=()):
    """Friction and pretension, their derivatives known; courses at right angles."""
    placed = [p if p not in held else replace(p, hold=("held",)) for p in (FRICTION, PRETENSION)]
    runs = Straight(dict(zip(placed, (COURSE, OTHER), strict=True)))
    captures = captures_of(runs, truth[0] * COURSE + truth[1] * OTHER)
    return captures, with_slopes(captures, evaluate(captures, placed, [np.array(x, float)])[0])


SQUARES = 16.0, 1e-4 * sum(k * k for k in range(16))
"""Of the two courses' quarters."""


def test_the_normal_equations_are_those_of_squares_over_the_variance():
    """Off by 0.1 and -2 N: with v = 4 (sum of squares/48 + f²), gradient and matrix are sums over v."""
    captures, at = of_two([0.2, 52.0])
    v = 4 * ((0.1**2 * SQUARES[0] + 2**2 * SQUARES[1]) / 48 + FLOOR**2)
    gradient, matrix = normal(captures.captures, at)
    np.testing.assert_allclose(gradient, [-0.1 * SQUARES[0] / v, 2 * SQUARES[1] / v], rtol=1e-9)
    np.testing.assert_allclose(matrix, np.diag(SQUARES) / v, rtol=1e-9, atol=1e-9)


def test_a_step_goes_almost_all_the_way_and_foretells_what_it_gains():
    """Damping is a hundredth of the curvature: 1/1.01 of the way e, of ½ m e² all but (1 - 1/1.01)²."""
    captures, at = of_two([0.2, 52.0])
    move, gain = step_from(captures.captures, at, np.array([10.0, 1e4]))
    np.testing.assert_allclose(move, np.array([0.1, -2.0]) / 1.01, rtol=1e-9)
    v = 4 * ((0.1**2 * SQUARES[0] + 2**2 * SQUARES[1]) / 48 + FLOOR**2)
    whole = 0.5 * (0.1**2 * SQUARES[0] + 2**2 * SQUARES[1]) / v
    assert gain == pytest.approx(whole * (1 - (0.01 / 1.01) ** 2), rel=1e-9)


@pytest.mark.parametrize(
    ("x", "truth", "stride", "move"),
    [
        ((0.2, 52.0), (0.3, 50.0), (0.04, 1.5), (0.04, -1.5)),  # the stride's ends, each way
        ((0.05, 4999.0), (-0.3, 5003.0), (1.0, 10.0), (-0.05, 1.0)),  # the bounds 0 and 5000 N
    ],
)
def test_a_step_ends_at_the_stride_or_at_a_bound(x, truth, stride, move):
    captures, at = of_two(x, truth)
    found, _ = step_from(captures.captures, at, np.array(stride))
    np.testing.assert_allclose(found, move, rtol=1e-9)


def test_what_is_held_stays_where_it_is():
    captures, at = of_two([0.2, 52.0], held=[PRETENSION])
    move, _ = step_from(captures.captures, at, np.array([10.0, 1e4]))
    np.testing.assert_allclose(move, [0.1 / 1.01, 0.0], rtol=1e-9)


def test_a_climb_tries_eight_differences_whole_and_shortened_and_then_what_is_left():
    """From 0 to 0.3: a difference of 0.03; 0.24 and 0.4 of it; then 1/1.01 of the last 0.06, and 0.4 of that."""
    runs, captures = of_friction()
    (start,) = evaluate(captures, [FRICTION], [np.zeros(1)])
    found = fit(captures, start, most=2)
    last = 0.06 / 1.01
    assert asked(runs) == pytest.approx([0.0, 0.03, 0.24, 0.096, 0.24 + last, 0.24 + 0.4 * last], rel=1e-9)
    assert found.x == pytest.approx([0.24 + last])
    assert found.likelihood == pytest.approx(height(16 * (0.06 - last) ** 2), rel=1e-6)
    assert found.slopes is not None
    np.testing.assert_allclose(found.slopes[0][0]["position"], -COURSE[::5], atol=1e-9)


def test_a_climb_takes_four_steps_unless_told_otherwise():
    """Of eight differences each: 4 · 0.24 of the 1.45 there are to go."""
    _, captures = of_friction(truth=1.45)
    assert fit(captures, evaluate(captures, [FRICTION], [np.zeros(1)])[0]).x == pytest.approx([0.96])


def test_a_climb_ends_where_a_step_is_a_fiftieth_of_a_difference():
    """0.02 · 0.03 = 0.0006: 0.00058 away it is left as it is, 0.00063 away (1/1.01 of which is longer) it is not."""
    for away, tried in ((0.00058, 0), (0.00063, 2)):
        runs, captures = of_friction()
        (start,) = evaluate(captures, [FRICTION], [np.array([0.3 - away])])
        fit(captures, with_slopes(captures, start), most=1)
        assert len(runs.asked) == 2 + tried


def test_a_climb_ends_once_a_step_gains_too_little():
    """Noise so large that the rest of the way gains 0.2 of L: it is taken, and no further step is tried."""
    for noise, tried in ((1.0, 2), (0.01, 4)):
        runs = Straight({FRICTION: COURSE})
        captures = captures_of(runs, 0.3 * COURSE, noise=noise * np.sqrt(5))
        (start,) = evaluate(captures, [FRICTION], [np.array([0.06])])
        found = fit(captures, start, most=2)
        assert len(runs.asked) == 2 + tried
        # With f = 1 m: 6 ln(1 + 0.24² · 16/48) = 0.114 in all, 1/1.01 of the way at once.
        if noise == 1.0:
            assert found.x == pytest.approx([0.06 + 0.24 / 1.01])


def test_where_both_lengths_lose_the_next_step_is_a_fifth_as_long_and_the_way_that_was_learnt():
    """Beyond 0.55 motion turns back: from 0.5, 0.24 and 0.096 further both lose; the shorter one's secant leads back.

    A fifth of 0.24 is 0.048.
    """
    runs, captures = of_friction(truth=0.3, law=lambda x: x - 0.5 if x < 0.55 else 0.5 - x)
    (start,) = evaluate(captures, [FRICTION], [np.array([0.5])])
    found = fit(captures, start, most=2)
    assert asked(runs) == pytest.approx([0.5, 0.53, 0.74, 0.596, 0.452, 0.5 - 0.4 * 0.048])
    assert found.x == pytest.approx([0.5])  # back is no better either


@pytest.mark.parametrize("case", ["cannot be simulated", "held", "no steps"])
def test_what_cannot_or_may_not_move_stays(case):
    held = replace(FRICTION, hold=("coefficient",))
    placed = held if case == "held" else FRICTION
    runs = Straight({placed: COURSE}, fails=lambda _: case == "cannot be simulated")
    captures = captures_of(runs, 0.3 * COURSE)
    (start,) = evaluate(captures, [placed], [np.zeros(1)])
    found = fit(captures, start, most=0 if case == "no steps" else 4)
    assert found.x == pytest.approx([0.0])
    assert len(runs.asked) == (1 if case == "cannot be simulated" else 2)  # derivatives, but no step


def test_broydens_update_agrees_with_the_step_and_shares_what_was_missed_by_squares_of_steps_in_differences():
    """A step of 2 differences along the first handle and 1 along the second misses by 5: 4/5 and 1/5 of it.

    Steps of 0.06 and 60: derivatives grow by 5 · 2/5 / 0.03 and 5 · 1/5 / 60; along the step by all of 5.
    """
    before = {"position": np.array([[1.0, 2.0]])}
    slopes = tuple(({"position": np.array([[a, 0.0]])},) for a in (10.0, 0.1))
    here = fit_of([FRICTION, PRETENSION], [0.1, 200.0], 0.0, [before], slopes=slopes)
    # Predicted are 10 · 0.06 + 0.1 · 60 = 6.6; 11.6 came.
    there = fit_of([FRICTION, PRETENSION], [0.16, 260.0], 1.0, [{"position": np.array([[12.6, 2.0]])}])
    first, second = _broyden(here, there, np.array([0.03, 60.0]))
    np.testing.assert_allclose(first[0]["position"], [[10.0 + 2.0 / 0.03, 0.0]], rtol=1e-12)
    np.testing.assert_allclose(second[0]["position"], [[0.1 + 1.0 / 60, 0.0]], rtol=1e-12)


def test_spread_is_the_inverse_root_of_what_the_recordings_say():
    """Columns (2, 0) and (1, 1) over v: the inverse of [[4, 2], [2, 2]]/v is [[2, -2], [-2, 4]] v/4. One moves nothing.

    Of the umbilical's root at 10 √(N/m), a step of 1: its value goes from 100 to 121, 21 for each unit.
    """
    columns = [[2.0, 0.0], [0.0, 0.0], [1.0, 1.0]]
    slopes = tuple(({"position": np.array([c])},) for c in columns)
    left = {"position": np.array([[0.3, 0.1]])}
    runs = Straight({})
    (own,) = captures_of(runs, along(0.0)).captures
    at = fit_of([FRICTION, CLEARANCE, UMBILICAL], [0.1, 0.0, 10.0], 0.0, [left], slopes=slopes)
    v = 4 * (0.1 / 2 + FLOOR**2)
    found = spread([own], at)
    assert found[0] == pytest.approx(np.sqrt(v / 2), rel=1e-9)
    assert found[1] == np.inf
    assert found[2] == pytest.approx(21 * np.sqrt(v), rel=1e-9)
