"""Before and after: which channels are shown, in which order, and what is said of each, counted by hand."""

import re
from dataclasses import replace

import numpy as np
import pytest
from diagnoses import spelt
from report_by_hand import WAVE, T, diagnosis, trace

from snarelab.identification.diagnosis import (
    ChannelFit,
    Misfit,
)
from snarelab.identification.report import answer, fit
from snarelab.identification.wording import foremost, verdict_sentence
from snarelab.report.provenance import Provenance


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [(2.0, 1.0, (0.25, 0.5)), (1.0, 3.0, (-0.5, 0.25)), (0.0, 0.0, (0.0, 0.0))],
)
def test_a_channels_change_is_the_drop_of_its_residual_over_its_measurement(before, after, wanted):
    assert fit._change(trace("a", before, after)) == pytest.approx(wanted)


def test_of_a_channel_that_reads_nothing_the_change_is_the_residuals_own():
    assert fit._change(replace(trace("a", 0, 0), measured=0 * T, before=-3 * WAVE, after=WAVE)) == (2.0, 3.0)


def test_a_root_mean_square_leaves_out_what_is_missing():
    assert fit._rms(np.array([3.0, np.nan, -4.0, np.inf])) == pytest.approx(np.sqrt(12.5))
    assert fit._rms(np.full(3, np.nan)) == fit._rms(np.zeros(0)) == 0.0


def test_the_channels_that_changed_most_stand_first_and_each_in_the_recording_where_it_did(asked):
    """Drops over 4: a 0.25, b 0.5 (in its second recording), c 0, d 0 but with more left; trained ones do not count."""
    kept = (
        trace("a", 2, 1),
        trace("b", 2, 1.5),
        trace("c", 1, 1),
        trace("d", 2, 2),
        trace("b", 3, 1, recording="c.csv"),
        trace("c", 3.9, 0.1, "train"),
    )
    key, title, content = fit.unseen(diagnosis(traces=kept, effects=spelt("x").effects))
    assert (key, title) == ("unseen", "Before and after, on held-out data")
    assert [(t.channel, t.recording, changed) for t, changed in asked] == [
        ("b", "c.csv", True),
        ("a", "b.csv", True),
        ("d", "b.csv", False),
        ("c", "b.csv", False),
    ]
    captions = re.findall(r"<figcaption>([^<]*)", content)
    assert captions[0] == "b in c.csv (held-out). Right: where the two models differ most."
    assert captions[2] == (
        "d in b.csv (held-out). The model before and after are alike here. Right: where the model misses most."
    )
    texts = re.findall(r'alt="([^"]*)', content)
    assert texts[0] == "b in c.csv: measured, model before and model after over time, and the residual below."
    assert texts[3] == "c in b.csv: measured, model over time, and the residual below."
    # The two that changed are open, the others folded.
    assert content.index("2 more channels</summary>") > content.index("a in b.csv (")
    assert content.index("2 more channels</summary>") < content.index("d in b.csv (")


def test_headline_and_first_picture_speak_of_the_same_channel(asked):
    """Two held-out recordings: a's error falls most over both together, b's most on one of them alone."""
    kept = (
        *(trace("a", 2, 1, recording=name) for name in ("b.csv", "c.csv")),
        trace("b", 3, 1, recording="b.csv"),
        trace("b", 0.4, 0.4, recording="c.csv", measured=40.0),
    )
    falls = {"a": (0.5, 0.25), "b": (0.0752, 0.0268)}  # of RMS over both recordings together
    fits = tuple(ChannelFit(c, "N*m", Misfit(1, 1, *x), Misfit(1, 1, *x), 0.1) for c, x in falls.items())
    named = spelt("x").effects
    sentence = verdict_sentence(named, fits, "")
    told = diagnosis(traces=kept, fit=fits, effects=named, sentence=sentence, foremost=foremost(named, fits).channel)
    assert "the error of a on the held-out recording falls from 50 % to 25 %" in sentence
    assert [t.channel for t in fit.most_changed(told)] == ["a", "b"]
    assert [t.channel for t in fit.most_changed(replace(told, foremost=""))] == ["b", "a"]  # else it chose by itself
    answer.answer(told, Provenance("", (), ()))
    fit.unseen(told, skip=1)
    assert [t.channel for t, _ in asked] == ["a", "b"]


def test_without_an_addition_nothing_is_said_of_before_and_after(asked):
    only = (trace("a", 2, 2, "train"),)
    _, title, content = fit.unseen(diagnosis(traces=only))
    assert title == "Model and measurement, on held-out data"
    assert "a in b.csv (training). Right: where the model misses most." in content
    assert [changed for _, changed in asked] == [False]


@pytest.mark.parametrize(
    ("changed", "shown", "label"),
    [
        ((True, False, False), 1, "2 more channels"),
        ((True, True, False), 2, "1 more channel"),
        ((False,) * 6, 4, "2 more channels"),  # none changed: four
        ((False,) * 5, 4, "1 more channel"),
        ((False,) * 4, 4, None),
        ((True,) * 6, 4, "2 more channels"),
        ((True, True), 2, None),
    ],
)
def test_four_pictures_at_most_are_open_and_those_that_did_not_change_are_folded(changed, shown, label):
    content = fit._open_and_folded([(x, f"[{i}]") for i, x in enumerate(changed)])
    top, _, below = content.partition("<details>")
    assert top == "".join(f"[{i}]" for i in range(shown))
    assert re.findall(r"\[\d\]", below) == [f"[{i}]" for i in range(shown, len(changed))]
    assert re.findall(r"<summary>(.*?)</summary>", below) == ([label] if label else [])


def test_a_channel_that_got_worse_is_open_beside_those_that_got_better():
    content = fit._open_and_folded([(True, "[better]"), (False, "[as before]"), (True, "[worse]")])
    assert content.startswith("[better][worse]<details>")
    assert "[as before]" in content
