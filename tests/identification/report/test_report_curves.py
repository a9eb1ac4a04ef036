"""The report's curves of a residual and of friction: points, means and bands; bins and limits by hand."""

from typing import Any, cast

import numpy as np
import pytest
from drawn_axes import TIME, drawn, lines, trace

from snarelab.identification.diagnosis import FrictionCurve
from snarelab.identification.report import curves
from snarelab.report.bins import binned
from snarelab.report.drawing import AFTER, BEFORE


@pytest.fixture(autouse=True)
def unwritten(monkeypatch):
    """Figures are handed out as they are before they become SVG."""
    monkeypatch.setattr(curves, "svg", lambda figure: figure)


@pytest.mark.parametrize(
    ("low", "high", "centres"),
    [
        (-1.0, 3.0, (-0.5, 0.5, 1.5, 2.5, 3.5)),
        (-0.5, 3.5, (-0.5, 0.5, 1.5, 2.5, 3.5)),  # zero is an edge
        (2.0, 6.0, (2.5, 3.5, 4.5, 5.5, 6.5)),
        (2.5, 6.5, (3.0, 4.0, 5.0, 6.0, 7.0)),  # no sign changes: from the lowest on
        (0.0, 4.0, (0.5, 1.5, 2.5, 3.5, 4.5)),
        (-4.5, -0.5, (-4.0, -3.0, -2.0, -1.0, 0.0)),
    ],
)
def test_bins_are_equally_wide_and_one_more_than_asked_for(low, high, centres):
    """The range is 4, in 4 bins."""
    found, mean, spread = binned(np.array([low, high]), np.zeros(2), 4)
    assert found == pytest.approx(centres)
    assert np.isnan(mean).all()
    assert np.isnan(spread).all()


def test_a_bin_has_mean_and_spread_from_eight_samples_on():
    """A sample on an edge belongs to what lies above: 8 samples in the first bin, 7 in the second, 9 in the last."""
    coordinate = np.r_[np.zeros(4), np.full(4, 0.9), np.full(7, 1.0), np.full(9, 4.0)]
    residual = np.r_[np.full(4, 1.0), np.full(4, 5.0), np.full(7, 100.0), np.full(9, -2.0)]
    _, mean, spread = binned(coordinate, residual, 4)
    np.testing.assert_array_equal(mean, [3.0, np.nan, np.nan, np.nan, -2.0])
    np.testing.assert_array_equal(spread, [2.0, np.nan, np.nan, np.nan, 0.0])


@pytest.mark.parametrize(
    ("coordinate", "moves"),
    [
        (np.arange(8.0), True),
        (np.arange(7.0), False),
        (np.r_[np.arange(7.0), np.nan], False),
        (np.r_[np.arange(8.0), np.nan], True),
        (np.linspace(0, 2e-9, 9), True),
        (np.linspace(0, 0.5e-9, 9), False),
        (1000 + np.linspace(0, 2e-6, 9), True),
        (np.linspace(0, 0.5e-6, 9) - 1000, False),  # relative to what is large
        (np.full(9, 3.0), False),
        (np.full(9, np.nan), False),
    ],
)
def test_a_coordinate_moves_by_more_than_rounding_in_eight_samples(coordinate, moves):
    assert curves._moves(coordinate) is moves


@pytest.mark.parametrize(
    ("residual", "limits"),
    [
        (np.arange(1001.0), (1 - 99.8, 999 + 99.8)),  # a thousandth off either end of 0 to 1000, and a tenth more
        (np.r_[np.nan, np.arange(1001.0), np.inf], (1 - 99.8, 999 + 99.8)),
        (np.full(5, 5.0), (4.0, 6.0)),
        (np.full(5, np.nan), (-1.0, 1.0)),
    ],
)
def test_limits_leave_out_the_outermost_thousandth(residual, limits):
    assert curves._limits(residual) == pytest.approx(limits)


def test_the_residual_stands_against_speed_and_position_in_their_units():
    """Steps of a sign: 2 before, and a quarter of it after, all traces together."""
    side = np.where(np.arange(1281) % 2, 0.5, -0.5)
    step = np.sign(np.cos(TIME))
    both = [trace(measured=2 * step + 1 + side, after=1 + 1.5 * step), trace(measured=1 + 0 * TIME + side)]
    both[1] = trace(measured=2 * step + side, before=0 * TIME, after=1.5 * step, speed=-np.cos(TIME))
    figure = drawn(curves.residual_curves(both, True))
    speed, position = figure.axes
    assert (speed.get_xlabel(), position.get_xlabel()) == ("speed [rad/s]", "position [rad]")
    assert speed.get_ylabel() == "tau.joint1 residual [N·m]"
    assert [x.get_text() for x in figure.legends[0].get_texts()] == ["before", "after"]
    points, mean, after, also = lines(speed)
    assert [x[0] for x in (points, mean, after, also)] == [BEFORE, BEFORE, AFTER, AFTER]
    assert len(points[1]) == 2500  # of 2562, first and last among them
    assert (points[1][0], points[1][-1]) == (2 - 0.5, 2 * step[-1] - 0.5)
    # At either sign of speed one of the two recordings is +2 and the other -2.
    assert mean[1][np.isfinite(mean[1])] == pytest.approx(0.0, abs=0.35)
    assert len(lines(position)) == 4
    assert position.get_ylim() == speed.get_ylim()
    low, high = speed.get_ylim()
    assert (low, high) == pytest.approx((-2.5 - 0.5, 2.5 + 0.5))


def test_a_residual_that_goes_with_the_sign_of_speed_shows_its_two_levels_and_a_band_of_one_deviation():
    side = np.where(np.arange(1281) % 2, 0.5, -0.5)
    one = trace(measured=1 + 2 * np.sign(np.cos(TIME)) + side)
    figure = drawn(curves.residual_curves([one], False))
    assert [x.get_text() for x in figure.legends[0].get_texts()] == ["model"]
    axes = figure.axes[0]
    points, mean = lines(axes)
    assert (points[0], mean[0], len(points[1])) == (AFTER, AFTER, 1281)
    centre = np.asarray(axes.lines[-1].get_xdata(), float)
    known = np.isfinite(mean[1])
    np.testing.assert_allclose(mean[1][known], 2 * np.sign(centre[known]), atol=0.25)
    (band,) = axes.collections
    corners = np.concatenate([p.vertices for p in cast(Any, band).get_paths()])[:, 1]
    assert (corners.min(), corners.max()) == pytest.approx((-2.5, 2.5), abs=0.25)


@pytest.mark.parametrize(
    ("unit", "moving", "labels"),
    [
        ("N", ("speed", "position"), ["speed [m/s]", "position [m]"]),
        ("rad", ("speed", "position"), ["speed", "position"]),
        ("N*m", ("position",), ["position [rad]"]),
        ("N*m", ("speed",), ["speed [rad/s]"]),
    ],
)
def test_only_what_moved_is_drawn_against(unit, moving, labels):
    still: dict[str, Any] = {name: np.full(1281, 0.3) for name in ("speed", "position") if name not in moving}
    figure = drawn(curves.residual_curves([trace(unit=unit, **still)], False))
    assert [axes.get_xlabel() for axes in figure.axes] == labels


def test_nothing_is_drawn_where_nothing_moved():
    still = np.full(1281, 0.3)
    assert curves.residual_curves([trace(speed=still, position=still)], True) is None


def test_a_sample_that_is_missing_on_either_side_is_no_point():
    measured, speed = np.arange(1281.0), np.cos(TIME)
    measured[:3], speed[-5:] = np.nan, np.nan
    figure = drawn(curves.residual_curves([trace(measured=measured, speed=speed)], False))
    np.testing.assert_array_equal(lines(figure.axes[0])[0][1], np.arange(3, 1276) - 1.0)
    empty = drawn(curves.residual_curves([trace(measured=np.full(1281, np.nan))], False))
    assert lines(empty.axes[0]) == []


def test_a_channel_that_is_known_only_where_nothing_moves_has_no_points():
    """The coordinate moves in its second half, where nothing is measured: one bin of no width could not be filled."""
    moves = np.concatenate([np.zeros(20), np.linspace(0, 1, 20)])
    known = np.where(np.arange(40) < 20, 1.0, np.nan)
    one = trace(measured=known, speed=moves, position=moves, before=np.zeros(40), after=np.zeros(40), time=moves)
    assert all(not axes.collections for axes in drawn(curves.residual_curves([one], True)).axes)


def test_a_friction_curve_has_its_band_its_parts_and_the_points_measured():
    speed = np.linspace(-1.0, 1.0, 5)
    viscous, dry = 2 * speed, 3 * np.sign(speed)
    points = np.array([-0.5, 0.5]), np.array([-4.2, 3.9]), np.array([0.1, 0.3])
    names = ("viscous_friction", "coulomb_friction")
    curve = FrictionCurve("a", "joint", names, speed, viscous + dry, np.full(5, 0.5), "N*m", (viscous, dry), points)
    axes: Any = drawn(curves.friction_over_speed(curve)).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_allclose(lines["friction"].get_ydata(), viscous + dry)
    np.testing.assert_allclose(lines["viscous friction"].get_ydata(), viscous)
    np.testing.assert_allclose(lines["Coulomb friction"].get_ydata(), dry)
    (measured,) = axes.containers
    at, (low, high) = measured.lines[0], (segment[:, 1] for segment in measured.lines[2][0].get_segments())
    np.testing.assert_allclose(at.get_xydata(), np.column_stack(points[:2]))
    np.testing.assert_allclose([low, high], [(-4.3, -4.1), (3.6, 4.2)])


def test_a_friction_of_one_law_has_no_parts_beside_it():
    speed = np.linspace(-1.0, 1.0, 5)
    curve = FrictionCurve("a", "joint", ("viscous_friction",), speed, speed, np.full(5, 0.5), "N*m", (speed,))
    axes: Any = drawn(curves.friction_over_speed(curve)).axes[0]
    assert [line.get_label() for line in axes.lines if not line.get_label().startswith("_")] == ["friction"]
    assert not axes.containers
