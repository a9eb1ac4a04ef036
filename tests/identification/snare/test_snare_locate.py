"""Where in a capture the misfit stands, and which body a force sensor reads: worked by hand on steps and jumps."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from snarelab.identification.snare.fit import CaptureFit
from snarelab.identification.snare.locate import _touch, _windows, locate_capture
from snarelab.identification.snare.recording import EVERY, CaptureRecording, Track, sensed_by
from snarelab.identification.snare.search import CaptureSelection
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.setup import CaptureSetup
from snarelab.models.snare.target import Target

TIMES = np.asarray(EVERY * np.arange(80), float)
"""Four seconds: 16 quarters, 8 half seconds."""
CENTRES = np.asarray(0.125 + 0.25 * np.arange(8), float)
"""[s] Middles of the quarters of two seconds."""
ZERO = 10.0
"""[s] A recording's clock at its first row."""
TOUCHED = 2.0
"""[s] From the start: a force of 5 N from then on."""


def in_quarters(numbers, value):
    """A column (80,) that is not zero in some quarters of a second."""
    return np.where(np.isin(np.arange(80) // 5, numbers), value, 0.0)


def track(x: ArrayLike = 0.0, y: ArrayLike = 0.0, **force):
    """The target goes 0.1 m along x and y halfway, and so much more as is given."""
    halfway = np.where(TIMES < 1.99, 0.0, 0.1)
    position = np.stack([halfway + np.asarray(x), halfway + np.asarray(y), 0.0 * TIMES], axis=1)
    return Track(position, np.tile([1.0, 0.0, 0.0, 0.0], (80, 1)), force)


def capture(measured, noise=0.1):
    sensors = dict.fromkeys(measured.force, "wrist")
    scatter = {"position": 1e-4, **dict.fromkeys(measured.force, noise)}
    setup = CaptureSetup(SnareParameters(), Target("free"))
    carried = dict.fromkeys(measured.force, 1.0)
    return CaptureRecording("a.csv", "target", TIMES, measured, sensors, setup, None, ZERO, scatter, carried, ())


def searched(before, after, named: Any = ()):
    first, last = (CaptureFit((), np.zeros(0), 0.0, (x,), ()) for x in (before, after))
    return CaptureSelection(named, first, last, first, last, (), (), 5.0)


def push(size=5.0):
    """A force (80, 3) of 3 : 4 : 0 from the touch on."""
    return np.outer(TIMES > TOUCHED - 0.01, [0.6 * size, 0.8 * size, 0.0])


@pytest.mark.parametrize("named", [(), ("an effect",)])
def test_channels_stand_by_the_share_of_their_own_motion_that_was_missed(named):
    """20 mm of x for half a second and 10 mm of y for as long, of motions alike: 4 to 1 of the energy."""
    missed = track(x=in_quarters([4, 5], 0.02), y=in_quarters([12, 13], -0.01), effector=push())
    measured = track(effector=push())
    # Where nothing was named, it is the measurement that the model misses; the last fit is then as the first.
    found = searched(missed, measured if named else missed, named)
    x, y = locate_capture(found, [capture(measured)])
    assert (x.channel, y.channel) == ("pos.target.x", "pos.target.y")
    assert (x.share, y.share) == pytest.approx((0.8, 0.2), rel=1e-9)
    # A position is a mean over 50 ms about its time: a quarter of a second begins 25 ms before its first one.
    assert x.time_windows == ((pytest.approx(ZERO + 0.975), pytest.approx(ZERO + 1.475)),)
    assert y.time_windows == ((pytest.approx(ZERO + 2.975), pytest.approx(ZERO + 3.475)),)
    assert x.where == "before contact, until 12.00 s (100 % of it)"
    assert y.where == "in contact, from 12.00 s on (100 % of it)"


def test_what_stands_on_both_sides_of_the_touch_is_no_matter_of_contact():
    """64 % of the energy after the touch is neither before contact nor nine tenths in it."""
    missed = track(x=in_quarters([6], 0.006) + in_quarters([10], 0.008), effector=push())
    (only,) = locate_capture(searched(missed, missed), [capture(track(effector=push()))])
    assert only.where == "throughout the capture"
    assert only.share == pytest.approx(1.0)


def test_without_a_force_nothing_is_said_of_contact():
    missed = track(x=in_quarters([4, 5], 0.02))
    (only,) = locate_capture(searched(missed, missed), [capture(track())])
    assert only.where == "throughout the capture"


def test_a_model_that_misses_nothing_has_no_place_to_look_at():
    assert locate_capture(searched(track(), track()), [capture(track())]) == ()


@pytest.mark.parametrize(
    ("size", "noise", "touched"),
    [
        (5.0, 0.1, ZERO + TOUCHED),  # above 0.5 N and above eight times the noise
        (5.0, 0.6, ZERO + TOUCHED),
        (5.0, 0.65, None),  # eight times the noise are 5.2 N
        (0.6, 1e-3, ZERO + TOUCHED),
        (0.4, 1e-3, None),  # half a newton is none, however quiet the sensor
    ],
)
def test_a_touch_is_the_first_force_beyond_noise_and_half_a_newton(size, noise, touched):
    found = _touch(capture(track(effector=push(size)), noise))
    assert np.isnan(found) if touched is None else found == pytest.approx(touched)


def test_a_gap_is_no_touch():
    force = push()
    force[:50] = np.nan
    assert _touch(capture(track(effector=force))) == pytest.approx(ZERO + TIMES[50])
    assert np.isnan(_touch(capture(track())))


@pytest.mark.parametrize(
    ("by_half_second", "spans"),
    [
        ((1, 3, 2, 1), [(0.5, 1.0)]),  # 9 of 15: one is enough
        ((3, 3, 1, 1), [(0.0, 1.0)]),  # 9 of 20 are not half of it: two, side by side
        ((3, 1, 1, 3), [(0.0, 0.5), (1.5, 2.0)]),  # the same apart
    ],
)
def test_windows_are_the_fewest_half_seconds_with_half_the_energy(by_half_second, spans):
    """Amplitudes by half second; their squares are what counts."""
    change = np.tile([1.0, -1.0], 4) * np.repeat(by_half_second, 2)
    found = _windows(CENTRES, np.asarray(change, float))
    np.testing.assert_allclose(found, spans, atol=1e-3)


def test_a_last_window_ends_with_the_recording():
    """Seven quarters: the last half second has but one of them."""
    assert _windows(CENTRES[:7], np.array([0, 0, 0, 0, 0, 0, 1.0])) == ((1.5, 1.75),)


@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
@pytest.mark.parametrize(
    ("cosine", "moved"), [(-1.0, False), (-0.6, False), (0.28, False), (0.6, True), (0.8, True), (1.0, True)]
)
def test_a_force_must_look_like_the_other_bodys_by_its_direction_whatever_its_size(size, cosine, moved):
    """Along x as measured; as simulated the cables draw the target at an angle to x, the end effector against it."""
    on_target = np.outer(TIMES > TOUCHED - 0.01, size * np.array([cosine, np.sqrt(1 - cosine**2), 0.0]))
    measured = np.outer(TIMES > TOUCHED - 0.01, [2.0 * size, 0.0, 0.0])
    found = sensed_by(capture(track(effector=measured)), track(effector=-on_target, target=on_target))
    assert found.sensors == ({"target": "wrist"} if moved else {"effector": "wrist"})
    assert list(found.measured.force) == list(found.sensors)
