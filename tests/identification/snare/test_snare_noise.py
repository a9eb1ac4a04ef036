"""What a capture's channels may be off by before and after the first touch: levels worked out by hand."""

import numpy as np
import pytest
from captures_by_hand import Straight, along

from snarelab.identification.snare.noise import DIFFER, noise_channels, touched
from snarelab.identification.sources.source import Linearisation, ModelPoint

N = 16
AT = ModelPoint((), {}, np.zeros(0), np.zeros(0))


def made(left, *, name="pos.target.x", could=None, touch=40, scale=1.0):
    """The one channel of a capture of four seconds, touched halfway."""
    track = Straight(along(*np.zeros(N)), touch=touch).one({})
    linear = Linearisation(AT, (np.asarray(left, float)[:, None],), ())
    columns = np.zeros((N, 0)) if could is None else could
    ((own,),) = noise_channels([name], [track], linear, [[columns]], np.array([scale]))
    return own


@pytest.mark.parametrize(("touch", "first"), [(0, 0), (40, 8), (42, 8), (45, 9), (80, N)])
def test_cables_touch_from_the_first_quarter_with_a_force_on(touch, first):
    track = Straight(along(*np.zeros(N)), touch=touch).one({})
    np.testing.assert_array_equal(touched(track), np.arange(N) >= first)


def test_what_once_touched_stays_so():
    """A cable that lets go has pushed the target out of its way."""
    track = Straight(along(*np.zeros(N)), touch=20).one({})
    track.force["target"][40:] = 0.0
    np.testing.assert_array_equal(touched(track), np.arange(N) >= 4)


def test_before_a_touch_only_sensors_are_off_and_then_what_nothing_explains():
    """5 mm and -5 mm in turn, 9 mm before the touch: 5 mm RMS of the eight quarters from there on."""
    own = made(np.where(np.arange(N) < 8, 9e-3, 5e-3 * (-1.0) ** np.arange(N)))
    assert own.level == pytest.approx(5e-3)
    np.testing.assert_array_equal(own.sticks[0], np.arange(N) >= 8)


def test_what_a_column_explains_is_not_counted_and_the_freedom_it_takes_is():
    """Of eight quarters a column explains all but 2 mm, - and + in turn: 2 mm · sqrt(8/7)."""
    column = np.ones((N, 1))
    own = made(7e-3 + 2e-3 * (-1.0) ** np.arange(N), could=column)
    assert own.level == pytest.approx(2e-3 * np.sqrt(8 / 7))


@pytest.mark.parametrize(
    ("name", "scale", "least"),
    [
        ("pos.target.y", 1.0, 2.5e-4),
        ("turn.target.y", 1.0, 4e-3),
        ("force.wrist.y", 3.0, 0.27),
        ("chatter.wrist", 9.0, 1.0),
    ],
)
def test_engines_that_are_both_right_differ_by_something(name, scale, least):
    assert made(np.zeros(N), name=name, scale=scale).level == pytest.approx(least)
    assert set(DIFFER) == {"pos", "turn", "force", "chatter"}


def test_a_capture_that_touches_nothing_is_as_its_sensors_are():
    own = made(np.full(N, 5e-3), touch=80)
    np.testing.assert_array_equal(own.sticks[0], 0.0)
