"""What is said of captures, and where the misfit stands: worked by hand on decisions of a few numbers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from captures_by_hand import Straight, along, capture, model_of, track

from snarelab.identification.diagnosis import ChannelFit, Misfit, ParameterShift
from snarelab.identification.snare.answer import _corrected, _foremost, _sentence, _size, _steps, _traces
from snarelab.identification.snare.locate import _touch, _windows, locate_capture
from snarelab.identification.snare.recording import EVERY, sensed_by
from snarelab.identification.snare.source import Captures
from snarelab.identification.sources.source import Linearisation, ModelPoint

AT = ModelPoint((), {}, np.zeros(0), np.zeros(1))
CENTRES = np.asarray(0.125 + 0.25 * np.arange(8), float)
"""[s] Middles of the quarters of two seconds."""


def channel(name, unit, left, motion=0.1, held=None):
    """RMS left of a motion, before and after alike, on the captures fitted and (the same unless given) held out."""
    train, other = (Misfit(rms, rms, rms / motion, rms / motion) for rms in (left, left if held is None else held))
    return ChannelFit(name, unit, train, other, 1e-5)


def test_an_adequate_model_is_told_by_its_worst_motion_on_the_capture_held_out():
    fits = [channel("pos.target.y", "m", 0.004), channel("pos.target.z", "m", 0.001, held=0.005),
            channel("force.wrist.x", "N", 3.0)]  # fmt: skip
    said = _sentence((), _foremost((), fits), "")
    assert said.startswith("The model is adequate")
    assert said.endswith("the error of pos.target.z is 5 mm.")


def test_numbers_that_are_better_taken_otherwise_are_listed():
    assert _corrected([]) == ""
    assert _corrected([ParameterShift("umbilical_stiffness.target.stiffness", "N/m", 1.0, 2.0, 0.1)]) == ""
    moved = [ParameterShift("capture.mass", "kg", 25.0, 12.0, 0.1), ParameterShift("capture.line", "m", 1.0, 2.0, 0.1)]
    assert _corrected(moved).endswith("fit better as mass = 12 kg, line = 2 m.")


def test_metres_are_told_in_millimetres_and_other_units_as_they_are():
    assert [_size(0.01234, "m"), _size(4.561, "N")] == ["12.3 mm", "4.56 N"]


def decided(source, before, after, names=()) -> Any:
    """A decision with these residuals on every recording."""

    def linear(left, numbers):
        return Linearisation(AT, tuple(np.asarray(left, float) for _ in numbers), ())

    train, held = linear(after, source.train), linear(after, source.held)
    best = SimpleNamespace(names=names, last=SimpleNamespace(train=train, held=held))
    found = SimpleNamespace(first=SimpleNamespace(train=linear(before, source.train)))
    return SimpleNamespace(found=found, best=best, before=linear(before, source.held), train=train, held=held)


def pushed(x=0.4):
    """The target goes from 0 to so many metres along x, at 2 N on the end effector, then 1 N."""
    force = np.repeat([[2.0, 0.0, 0.0], [1.0, 0.0, 0.0]], 5, axis=0)
    return capture(track(along(0.0, x), effector=force), zero=5.0, path="data/b.csv")


def of_two():
    runs: Any = Straight(along(0.0, 0.0))
    return Captures(model_of(), [pushed(), pushed()], 1, runs)


def left(x, force=0.0):
    found = np.zeros((2, 7))
    found[1, 0], found[:, 3] = x, force
    return found


def test_steps_are_the_mean_of_motions_and_forces_shares():
    """Of 0.4 m at the end 0.2 and then 0.1 m missed: 1/4 and 1/16 of the energy; forces are met."""
    source = of_two()
    name = SimpleNamespace(placed=SimpleNamespace(effect=SimpleNamespace(name="contact_friction"), at="pin"))
    first, second = _steps(source, decided(source, left(0.2), left(0.1), [name]))
    assert (first.label, second.label) == ("model as given", "+ contact_friction at pin")
    assert (first.train, first.holdout) == pytest.approx((np.sqrt(1 / 8),) * 2)
    assert (second.train, second.holdout) == pytest.approx((np.sqrt(1 / 32),) * 2)


def test_traces_hold_measured_and_modelled_motion_and_force_of_each_capture():
    source = of_two()
    found = _traces(source, decided(source, left(0.3), left(0.1, force=0.5)))
    assert [(t.recording, t.role) for t in found[::6]] == [("b.csv", "train"), ("b.csv", "holdout")]
    assert [t.unit for t in found[:6]] == ["m"] * 3 + ["N"] * 3
    x, force = found[0], found[3]
    np.testing.assert_allclose(x.time, [5.1, 5.35])
    np.testing.assert_allclose(x.measured, [0.0, 0.4])
    np.testing.assert_allclose((x.before, x.after), [[0.0, 0.1], [0.0, 0.3]], atol=1e-12)
    np.testing.assert_allclose(x.speed, [1.6, 1.6])  # 0.4 m in a quarter of a second
    np.testing.assert_allclose((force.measured, force.after), [[2.0, 1.0], [1.5, 0.5]])
    np.testing.assert_allclose(force.position, [0.0, 0.4])


# Where


def moving(missed, named=True, force=None):
    """The target goes 0.1 m along x and y halfway through four seconds; so much (16, 3) of its motion was missed."""
    place = along(*([(0.0, 0.0, 0.0)] * 8 + [(0.1, 0.1, 0.0)] * 8))
    own = capture(track(place, **({} if force is None else {"effector": force})), zero=10.0, noise=0.1)
    runs: Any = Straight(place)
    source = Captures(model_of(), [own], 1, runs)
    x = np.zeros((16, len(source.channels)))
    x[:, :3] = missed
    return locate_capture(source, decided(source, x, 0 * x if named else x, ["an effect"] if named else []))


def missing(**axes):
    """Columns (16, 3): by axis, quarters of a second and what is missed in them."""
    x = np.zeros((16, 3))
    for axis, (quarters, value) in axes.items():
        x[quarters, "xyz".index(axis)] = value
    return x


def push(size=5.0):
    """A force (80, 3) of 3 : 4 : 0 from 2 s on."""
    return np.outer(EVERY * np.arange(80) > 1.99, [0.6 * size, 0.8 * size, 0.0])


@pytest.mark.parametrize("named", [True, False])
def test_channels_stand_by_the_share_of_the_motion_that_was_missed(named):
    """20 mm of x for half a second and 10 mm of y for as long: 4 to 1 of the energy."""
    x, y = moving(missing(x=([4, 5], 0.02), y=([12, 13], -0.01)), named, push())
    assert (x.channel, y.channel) == ("pos.target.x", "pos.target.y")
    assert (x.share, y.share) == pytest.approx((0.8, 0.2), rel=1e-9)
    # A position is a mean over 50 ms about its time: a quarter of a second begins 25 ms before its first one.
    assert x.time_windows == ((pytest.approx(10.975), pytest.approx(11.475)),)
    assert x.where == "before contact, until 12.00 s (100 % of it)"
    assert y.where == "in contact, from 12.00 s on (100 % of it)"


def test_what_stands_on_both_sides_of_the_touch_is_no_matter_of_contact():
    """64 % of the energy after the touch is neither before contact nor nine tenths in it."""
    both = missing(x=([6], 0.006)) + missing(x=([10], 0.008))
    (only,) = moving(both, force=push())
    assert (only.where, only.share) == ("throughout the capture", pytest.approx(1.0))
    assert moving(missing(x=([4], 0.02)))[0].where == "throughout the capture"  # no force, no touch
    assert moving(0 * both) == ()


@pytest.mark.parametrize(
    ("size", "noise", "touched"),
    [
        (5.0, 0.1, True),  # above 0.5 N and above eight times the noise
        (5.0, 0.65, False),  # eight times the noise are 5.2 N
        (0.6, 1e-3, True),
        (0.4, 1e-3, False),  # half a newton is none, however quiet the sensor
    ],
)
def test_a_touch_is_the_first_force_beyond_noise_and_half_a_newton(size, noise, touched):
    found = _touch(capture(track(np.zeros((80, 3)), effector=push(size)), zero=10.0, noise=noise))
    assert found == pytest.approx(12.0) if touched else np.isnan(found)


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
    np.testing.assert_allclose(_windows(CENTRES, np.asarray(change, float)), spans, atol=1e-3)


def test_a_last_window_ends_with_the_recording():
    """Seven quarters: the last half second has but one of them."""
    assert _windows(CENTRES[:7], np.array([0, 0, 0, 0, 0, 0, 1.0])) == ((1.5, 1.75),)


@pytest.mark.parametrize("size", [0.01, 1.0, 300.0])
@pytest.mark.parametrize(
    ("cosine", "moved"), [(-1.0, False), (-0.6, False), (0.28, False), (0.6, True), (0.8, True), (1.0, True)]
)
def test_a_force_must_look_like_the_other_bodys_by_its_direction_whatever_its_size(size, cosine, moved):
    """Along x as measured; as simulated the cables draw the target at an angle to x, the end effector against it."""
    late = EVERY * np.arange(80) > 1.99
    on_target = np.outer(late, size * np.array([cosine, np.sqrt(1 - cosine**2), 0.0]))
    own = capture(track(np.zeros((80, 3)), effector=np.outer(late, [2.0 * size, 0.0, 0.0])))
    found = sensed_by(own, track(np.zeros((80, 3)), effector=-on_target, target=on_target))
    assert found.sensors == ({"target": "wrist"} if moved else {"effector": "wrist"})
    assert list(found.measured.force) == list(found.sensors)
