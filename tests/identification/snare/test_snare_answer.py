"""What is said of captures: verdicts and sentences from channels' misfits, worked by hand."""

import pytest

from snarelab.identification.diagnosis import ChannelFit, Misfit
from snarelab.identification.snare.answer import _corrected, _sentence, _unexplained, _unexplained_words


def channel(name, unit, left, motion=0.1, held=None):
    """RMS left of a motion, before and after alike, on the captures fitted and (the same unless given) held out."""
    train, other = (Misfit(rms, rms, rms / motion, rms / motion) for rms in (left, left if held is None else held))
    return ChannelFit(name, unit, train, other, 1e-5)


Y, FORCE = channel("pos.target.y", "m", 0.004), channel("force.wrist.x", "N", 3.0, motion=4.0)


def test_what_is_left_small_or_is_a_force_alone_is_no_unknown_effect():
    """A quarter of the largest motion, and a millimetre on both sets: a force's shape is sensed worse than motion."""
    assert _unexplained([Y, FORCE]) == ()
    assert _unexplained([Y, channel("pos.target.z", "m", 0.0009, motion=0.0010)]) == ()
    assert _unexplained([Y, channel("pos.target.z", "m", 0.026, held=0.0009)]) == ()


@pytest.mark.parametrize("direction", ["y", "z"])
def test_motion_that_is_left_without_a_name_is_told_with_its_size(direction):
    left = channel(f"pos.target.{direction}", "m", 0.026)
    text = _unexplained_words(_unexplained([left, channel("pos.target.x", "m", 0.024), FORCE]))
    assert text.startswith(f"26 mm of pos.target.{direction} remain")
    assert "check the set-up's sizes and masses" in text
    assert _sentence((), [left, FORCE], text).startswith(
        "Something is missing that no effect of the vocabulary explains"
    )


def test_an_adequate_model_is_told_by_its_worst_motion_on_the_capture_held_out():
    said = _sentence((), [Y, channel("pos.target.z", "m", 0.001, held=0.005), FORCE], "")
    assert said.startswith("The model is adequate")
    assert said.endswith("the error of pos.target.z is 5 mm.")


def test_numbers_that_are_better_taken_otherwise_are_listed():
    assert _corrected([]) == ""
    assert _corrected(["mass = 12 kg", "line = 2 m"]).endswith("fit better as mass = 12 kg, line = 2 m.")
