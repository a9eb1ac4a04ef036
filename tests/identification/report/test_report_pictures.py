"""The report's pictures over time and of sizes: which numbers stand where, what is shaded, what is named."""

from typing import Any, cast

import numpy as np
import pytest
from drawn_axes import TIME, drawn, lines, shaded, spikes, trace
from matplotlib.colors import to_hex

from snarelab.identification.diagnosis import Candidate, Location, Step
from snarelab.identification.report import figures
from snarelab.report.drawing import AFTER, BEFORE, GREY, MEASURED


@pytest.fixture(autouse=True)
def unwritten(monkeypatch):
    """Figures are handed out as they are before they become SVG."""
    monkeypatch.setattr(figures, "svg", lambda figure: figure)


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
