"""The report's pictures: which numbers stand where, what is shaded, what is named; bins and limits by hand."""

from typing import Any, cast

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from snarelab.identification.diagnosis import Candidate, FrictionCurve, Location, Step, Trace
from snarelab.identification.report import curves, figures
from snarelab.report.bins import binned
from snarelab.report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE

TIME = np.arange(1281) / 64
"""20 s at 64 Hz: every time is exact in binary, and no line is thinned."""


@pytest.fixture(autouse=True)
def unwritten(monkeypatch):
    """Figures are handed out as they are before they become SVG."""
    for module in (figures, curves):
        monkeypatch.setattr(module, "svg", lambda figure: figure)


def drawn(made: Any) -> Figure:
    return cast(Figure, made)


def trace(channel="tau.joint1", unit="N*m", **columns: Any):
    """Measured 1, model 1 and 1 unless said otherwise; a file name of its own."""
    given = {"time": TIME, "position": np.sin(TIME), "speed": np.cos(TIME)} | columns
    ones = np.ones(len(given["time"]))
    made = {name: given.get(name, ones) for name in ("measured", "before", "after")}
    return Trace(f"{channel}.csv", "train", channel, unit, given["time"], given["position"], given["speed"], **made)


def spikes(**heights):
    """A signal of TIME that is zero but for these heights, at times named by s<seconds>."""
    signal = np.zeros(len(TIME))
    for at, height in heights.items():
        signal[int(64 * float(at[1:]))] = height
    return signal


def lines(axes):
    """(colour, values, label) of the lines over time; level ones at zero are the axis."""
    found = [(to_hex(x.get_color()).upper(), np.asarray(x.get_ydata(), float), str(x.get_label())) for x in axes.lines]
    return [entry for entry in found if entry[0] != GREY]


def shaded(axes):
    """Start and end of the shaded windows."""
    boxes = [p for p in axes.patches if to_hex(p.get_facecolor()).upper() == SHADE]
    return [(p.get_x(), p.get_x() + p.get_width()) for p in boxes]


@pytest.mark.parametrize(
    ("signal", "wanted"),
    [
        (spikes(s7=1.0), (5.75, 7.0)),  # the first stretch of 1.25 s that reaches the spike, its end included
        (spikes(s7=2.0, s8=-2.0, s15=-3.0), (13.75, 15.0)),  # of energies 8 and 9 the larger
        (spikes(s7=2.25, s8=-2.25, s15=-3.0), (6.75, 8.0)),  # 10.1 and 9
        (spikes(s20=5.0, s4=1.0), (18.75, 20.0)),  # the last stretch that is whole
        (spikes(s7=1.0, s3=np.nan), (5.75, 7.0)),
        (0 * TIME, (0.0, 1.25)),
    ],
)
def test_the_stretch_of_most_interest_holds_most_of_the_energy(signal, wanted):
    """A sixteenth of 20 s is 1.25 s."""
    assert figures._stretch(TIME, signal, 0.0625) == wanted


def test_a_stretch_is_sixty_samples_at_least_and_the_whole_recording_at_most():
    """60 / 64 s is more than a sixteenth of 4 s; half a second has no stretch of that length."""
    short, very = TIME[:257], TIME[:33] + 3.0
    assert figures._stretch(short, spikes(s2=1.0)[:257], 0.0625) == (2.0 - 60 / 64, 2.0)
    assert figures._stretch(short, spikes(s2=1.0)[:257], 0.5) == (0.0, 2.0)
    assert figures._stretch(very, spikes(s0=0.0)[:33] + 1) == (3.0, 3.5)
    start, end = figures._stretch(TIME, spikes(s7=1.0))
    assert end - start == pytest.approx(0.06 * 20)


def test_the_residual_stands_over_time_with_its_own_windows_shaded():
    wave = np.sin(TIME)
    rows = [trace(before=1 - wave), trace("tau.joint2", "kg*m/s**2", measured=0 * TIME, before=wave)]
    places = [
        Location("tau.joint2", 0.5, ((1.0, 2.0), (4.0, 7.5)), ""),
        Location("tau.joint1", 0.3, ((3.0, 3.5),), ""),
        Location("tau.joint2", 0.2, ((-9.0, 44.0),), ""),
    ]
    one, two = drawn(figures.residual_over_time(rows, places)).axes
    for axes, wanted in ((one, wave), (two, -wave)):
        ((colour, values, _),) = lines(axes)
        assert colour == BEFORE
        np.testing.assert_allclose(values, wanted, atol=1e-12)
        assert axes.get_xlim()[0] > -1  # a window far outside does not widen the picture
        assert axes.get_xlim()[1] < 21
    assert shaded(one) == [(3.0, 3.5)]
    assert shaded(two) == [(1.0, 2.0), (4.0, 7.5), (-9.0, 44.0)]
    assert [axes.get_title("left") for axes in (one, two)] == [
        "tau.joint1, tau.joint1.csv",
        "tau.joint2, tau.joint2.csv",
    ]
    assert [axes.get_ylabel() for axes in (one, two)] == ["residual [N·m]", "residual [kg·m/s²]"]
    assert [axes.get_xlabel() for axes in (one, two)] == ["", "time [s]"]


def test_before_and_after_stand_above_and_their_residuals_below():
    """They differ by a spike at 8 s, and both miss another at 3 s: the stretch shown is that of the difference."""
    measured, before = np.cos(TIME) + spikes(s3=4.0), np.cos(TIME) - spikes(s8=1.0)
    one = trace(measured=measured, before=before, after=np.cos(TIME))
    figure = drawn(figures.before_and_after(one, True))
    upper, closer, lower, close = figure.axes
    for axes, inside in ((upper, TIME >= 0), (closer, (TIME >= 6.8) & (TIME <= 8.01))):
        assert [(c, n) for c, _, n in lines(axes)] == [
            (MEASURED, "measured"),
            (BEFORE, "model before"),
            (AFTER, "model after"),
        ]
        for (_, values, _), wanted in zip(lines(axes), (measured, before, np.cos(TIME)), strict=True):
            np.testing.assert_allclose(values, wanted[inside])
    for axes, inside in ((lower, TIME >= 0), (close, (TIME >= 6.8) & (TIME <= 8.01))):
        assert [c for c, _, _ in lines(axes)] == [BEFORE, AFTER]
        for (_, values, _), wanted in zip(lines(axes), (measured - before, spikes(s3=4.0)), strict=True):
            np.testing.assert_allclose(values, wanted[inside], atol=1e-12)
    for axes in (upper, lower):
        ((left, right),) = shaded(axes)
        assert (left, right) == pytest.approx((8 - 1.2, 8.0), abs=1 / 64)
    assert shaded(closer) == shaded(close) == []
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("tau.joint1 [N·m]", "residual [N·m]")
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "time [s]", "time [s]"]
    assert close.get_xlim() == closer.get_xlim()
    assert [x.get_text() for x in figure.legends[0].get_texts()] == ["measured", "model before", "model after"]


def test_a_model_that_did_not_change_is_drawn_once_where_it_misses_most():
    measured = np.cos(TIME) + spikes(s3=4.0)
    one = trace(measured=measured, before=np.cos(TIME), after=np.cos(TIME) - spikes(s8=1.0))
    upper, _, lower, _ = drawn(figures.before_and_after(one, False)).axes
    assert [(c, n) for c, _, n in lines(upper)] == [(MEASURED, "measured"), (AFTER, "model")]
    np.testing.assert_allclose(lines(upper)[1][1], np.cos(TIME))
    ((colour, values, _),) = lines(lower)
    assert colour == AFTER
    np.testing.assert_allclose(values, spikes(s3=4.0), atol=1e-12)
    assert shaded(upper)[0] == pytest.approx((3 - 1.2, 3.0), abs=1 / 64)


def bars(axes):
    """(colour, middle, length) of horizontal bars."""
    return [
        (to_hex(p.get_facecolor()).upper(), round(p.get_y() + p.get_height() / 2, 6), round(p.get_width(), 6))
        for p in axes.patches
    ]


def test_each_step_has_two_bars_in_per_cent_and_its_number_beside_each():
    rows = [Step("as given", 0.5, 0.25), Step("+ more", 0.125, float("nan"))]
    figure = drawn(figures.steps(rows))
    (axes,) = figure.axes
    first, second, third, fourth = bars(axes)
    assert (first, second) == ((GREY, -0.19, 50.0), (GREY, 0.81, 12.5))
    assert third == (AFTER, 0.19, 25.0)
    assert fourth[:2] == (AFTER, 1.19)
    assert [(x.get_text(), x.xy) for x in cast(Any, axes.texts)] == [
        ("50.0 %", (50.0, -0.19)),
        ("12.5 %", (12.5, 0.81)),
        ("25.0 %", (25.0, 0.19)),
    ]
    assert [x.get_text() for x in figure.legends[0].get_texts()] == ["training", "held-out"]


def test_a_candidate_that_was_named_stands_out_of_those_that_were_not():
    rows = [
        Candidate("coulomb_friction", "joint1", 0.4, 9.0, True),
        Candidate("sensor_bias", "tau.joint2", 0.25, 5.0, False),
        Candidate("backlash", "joint3", 0.125, 3.0, True),
    ]
    figure = drawn(figures.candidates(rows))
    (axes,) = figure.axes
    assert bars(axes) == [(BEFORE, 0.0, 40.0), (BEFORE, 2.0, 12.5), (GREY, 1.0, 25.0)]
    assert [x.get_text() for x in cast(Any, axes.texts)] == ["40.0 %", "25.0 %", "12.5 %"]
    shown = axes.get_yticklabels()
    assert [x.get_text() for x in shown] == ["Coulomb friction, joint1", "sensor bias, tau.joint2", "backlash, joint3"]
    assert [x.get_fontweight() for x in shown] == ["bold", "normal", "bold"]
    bottom, top = axes.get_ylim()
    assert top < 0 < 2 < bottom  # the first on top
    assert [x.get_text() for x in figure.legends[0].get_texts()] == ["named", "not named"]


def test_a_label_of_over_52_letters_is_cut_to_51_and_a_sign():
    _, axes = figures._bars(["a" * 52, "b" * 53], 0.3, 8.0)
    assert [x.get_text() for x in axes.get_yticklabels()] == ["a" * 52, "b" * 51 + "…"]


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
