"""The words of a diagnosis: shares, lists, the experiment that is proposed, and the first sentence."""

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification import reliability
from snarelab.identification.diagnosis import ChannelFit, Misfit
from snarelab.identification.nuisance.noise import Noise
from snarelab.identification.wording import (
    evidence_sentence,
    experiment_sentence,
    from_to,
    listed,
    named,
    noise_words,
    verdict_sentence,
)
from snarelab.report.words import percent


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.0123, "1.2 %"),
        (0.0999, "10 %"),
        (0.1, "10 %"),
        (0.104, "10 %"),
        (0.106, "11 %"),
        (1.234, "123 %"),
        (-0.056, "−5.6 %"),
        (-0.25, "−25 %"),
    ],
)
def test_a_share_has_two_digits_below_ten_per_cent_and_whole_ones_above(share, text):
    assert percent(share) == text


@pytest.mark.parametrize(
    ("items", "text"), [([], ""), (["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "a, b and c")]
)
def test_a_list_ends_with_and(items, text):
    assert listed(items) == text


def placed(at, experiment, sentence="friction that rubs"):
    made: Any = SimpleNamespace(at=at, effect=SimpleNamespace(experiment=experiment, sentence=sentence))
    return made


@pytest.mark.parametrize(
    ("own", "other", "text"),
    [
        ("turn {at}", "load {at}", "load joint2"),  # the rival's own experiment, at the rival's joint
        ("turn {at}", "turn {at}", "turn joint1"),
        ("turn {at}", "", "turn joint1"),
    ],
)
def test_the_rivals_experiment_is_proposed_where_it_is_another(own, other, text):
    for sensor in ("tau.", "q."):
        assert experiment_sentence(placed(f"{sensor}joint1", own), placed(f"{sensor}joint2", other)) == text


@pytest.mark.parametrize(
    ("channels", "where"), [(["a"], "a"), (["a", "b"], "a and b"), (["a", "b", "c"], "3 channels")]
)
def test_evidence_tells_what_is_explained_where_and_what_happens_without(channels, where):
    assert evidence_sentence(placed("joint1", ""), channels, 0.08, 0.1) == (
        f"Friction that rubs: it explains 36 % of the remaining residual of {where}. "
        "Without it, the error on the held-out recording rises from 8.0 % to 10 %."
    )


def channel(name, before, after):
    """Shares held out; those of the recordings fitted say the contrary."""
    return ChannelFit(name, "N*m", Misfit(1.0, 1.0, after, before), Misfit(1.0, 1.0, before, after), 0.0)


FITS = [channel("tau.joint1", 0.30, 0.28), channel("tau.joint2", 0.25, 0.05)]
"""The first is worst before; the second gains most."""


def test_the_first_sentence_lists_places_by_effect_and_the_channel_that_gained_most():
    some: Any = [
        SimpleNamespace(name=n, at=a, probability=0.9)
        for n, a in (("backlash", "a"), ("sensor_gain", "b"), ("backlash", "c"))
    ]
    assert verdict_sentence(some, FITS, " And more.") == (
        "The model leaves out backlash at a and c and sensor gain at b. With that added, the error of tau.joint2 on "
        "the held-out recording falls from 25 % to 5.0 %. And more."
    )


def test_an_error_that_rises_is_said_to_rise():
    some: Any = [SimpleNamespace(name="backlash", at="a", probability=0.9)]
    assert verdict_sentence(some, [channel("tau.joint1", 0.26, 1.0)], "").endswith("rises from 26 % to 100 %.")


def test_without_a_name_it_is_the_worst_channel_that_is_told():
    assert verdict_sentence([], FITS, " Torque.") == (
        "Something is missing on tau.joint1 that no effect of the vocabulary explains. Torque."
    )
    assert verdict_sentence([], FITS, "") == (
        "The model is adequate: nothing larger than the limits listed is left out. "
        "The remaining residual on the held-out recording is 30 % of tau.joint1."
    )
    told = verdict_sentence([], FITS, "", {"tau.joint1": "5 N·m from sample to sample", "tau.joint2": "none"})
    assert told.endswith("is 30 % of tau.joint1. It is noise: 5 N·m from sample to sample.")
    noisy = replace(FITS[1], noise_floor=0.8)
    assert verdict_sentence([], [FITS[0], noisy], "").endswith(
        "is 25 % of tau.joint2, 1.2 times that channel's noise floor."
    )


@contextmanager
def forgotten():
    """What was read of the stored file is read anew, and not kept."""
    reliability._stored.cache_clear()
    try:
        yield
    finally:
        reliability._stored.cache_clear()


@pytest.mark.parametrize(
    ("gain", "held", "share", "odds"),
    [
        (0.0, 1.0, 0.5, np.exp(-1)),
        (np.e - 1, 1.0, 0.5, np.exp(-0.5)),  # half a unit for each of log(1 + gain)
        (0.0, 4.0, 0.5, np.exp(-1) * 16),  # odds grow with the square of what the held-out recordings gain
        (-3.0, 1.0, 0.5, np.exp(-1)),
        (0.0, -7.0, 0.5, np.exp(-1) * 1e-6),  # what they lose counts as next to nothing gained
        (0.0, 1.0, 0.8, np.exp(-1) * 2),  # and with the root of the odds of the share
        (0.0, 1.0, 0.0, np.exp(-1) / np.sqrt(999)),
    ],
)
def test_how_often_a_name_of_torques_is_right_is_logistic_in_its_evidence(
    gain, held, share, odds, tmp_path, monkeypatch
):
    (tmp_path / "reliability.json").write_text('{"logit": [-1.0, 0.5, 2.0, 0.5]}')
    monkeypatch.setattr(reliability, "__file__", str(tmp_path / "reliability.py"))
    with forgotten():
        assert reliability.of_name(gain, held, share) == pytest.approx(odds / (1 + odds), rel=1e-12)


def test_what_a_noise_is_made_of_is_told_with_sizes_and_times():
    """Of the encoders the RMS over all recordings, of any length: √((3 · 4 + 5 · 0) / 8) = √1.5 here."""
    noise = Noise(0.0123, 0.2, 0.345, 4.0, 40.0, 9.0)
    told = noise_words("N*m", noise, [np.full(3, 2.0), np.zeros(5)])
    assert told == (
        "0.012 N·m from sample to sample, 0.2 N·m over 0.34 s, a wander of 4 N·m over 40 s and 1.2 N·m of the encoders"
    )
    assert "0.2 N·m over 0.34 s (smooth), a wander" in noise_words("N*m", replace(noise, order=2), [np.zeros(5)])


@pytest.mark.parametrize(
    ("before", "after", "text"),
    [
        (0.14, 0.031, "from 14 % to 3.1 %"),
        (0.1442, 0.1365, "from 14.4 % to 13.7 %"),  # both 14 % to two digits
        (0.0567, 0.0566, "from 5.67 % to 5.66 %"),
        (0.05674, 0.05671, "from 5.674 % to 5.671 %"),
        (0.05, 0.05, "from 5.000 % to 5.000 %"),
    ],
)
def test_two_errors_have_the_digits_that_part_them(before, after, text):
    assert from_to(before, after) == text


def test_what_is_less_likely_than_not_is_said_last_and_so():
    def finding(name, at, probability) -> Any:
        return SimpleNamespace(name=name, at=at, probability=probability)

    some = [finding("backlash", "a", 0.25), finding("sensor_gain", "b", 0.9), finding("rotor_inertia", "c", 0.4)]
    assert named(some) == "sensor gain at b, and perhaps rotor inertia at c (40 %) and backlash at a (25 %)"
    assert named(some[:1]) == "something, perhaps backlash at a (25 %)"


def test_nothing_explains_more_than_all():
    assert "it explains all of the remaining residual of a." in evidence_sentence(
        placed("joint1", ""), ["a"], 0.001, 0.26
    )
