"""How results print and show themselves in a notebook, and what they pass on, from small invented answers."""

import json
import re
from dataclasses import FrozenInstanceError, replace
from html import unescape
from types import SimpleNamespace
from typing import Any

import pytest
from diagnoses import spelt
from pages import Page

from snarelab import __version__
from snarelab.errors import InputError
from snarelab.identification import results
from snarelab.identification.diagnosis import Step
from snarelab.identification.results import DiagnosisResult, IdentificationResult, ParameterEstimate
from snarelab.report.words import chance

MODEL: Any = SimpleNamespace(name="arm<6>")
STEPS = (Step("as <given>", 0.12345, 0.5), Step("+ one", 0.0125, 1.0))
SAID = replace(spelt("x"), sentence="It is so & so.", steps=STEPS, notes=("first", "sec<nd"))


def rows(markup):
    """Cells of all rows below the heads, table by table."""
    found = []
    for body in re.findall(r"<tbody>(.*?)</tbody>", markup, re.S):
        lines = re.findall(r"<tr>(.*?)</tr>", body, re.S)
        found.append([[unescape(c) for c in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", line)] for line in lines])
    return found


def test_a_diagnosis_prints_its_sentence_and_a_line_a_step():
    one = DiagnosisResult(SAID, MODEL)
    first, *lines = str(one).split("\n")
    assert first == "It is so & so."
    assert lines[:2] == [
        "  as <given>" + " " * 51 + "training   12.3 %   held-out   50.0 %",
        "  + one" + " " * 56 + "training   1.25 %   held-out    100 %",
    ]
    assert lines[2:4] == ["", f"  {'what was found':<44} probability   value"]
    assert len(lines[4:]) >= len(SAID.effects)
    for effect in SAID.effects:
        assert any(f"at {effect.at}" in line and chance(effect.probability) in line for line in lines[4:])
    assert repr(one) == str(one)


def test_a_diagnosis_hands_out_what_it_holds():
    one = DiagnosisResult(SAID, MODEL)
    assert (one.verdict, one.sentence, one.steps) == ("missing_physics", "It is so & so.", STEPS)
    assert (one.effects, one.fit) == (SAID.effects, SAID.fit)
    assert one.to_json()["sentence"] == "It is so & so."


def test_a_further_term_of_a_series_has_the_vocabularys_word():
    first = SAID.effects[0]
    second = replace(first, name="torque_ripple_2")
    found = DiagnosisResult(replace(SAID, effects=(replace(first, name="torque_ripple"), second)), MODEL).to_json()
    assert [e["name"] for e in found["effects"]] == ["torque_ripple", "torque_ripple"]
    assert [e.get("term") for e in found["effects"]] == [None, 2]


def test_json_has_null_for_what_is_no_number():
    """At a low band a channel was left without a sample, and its floor was infinite: the file could not be written."""
    nothing = replace(spelt("x"), steps=(Step("as given", float("inf"), float("nan")),))
    content = DiagnosisResult(nothing, MODEL).to_json()
    assert content["steps"] == [{"label": "as given", "train": None, "holdout": None}]
    assert json.loads(json.dumps(content, allow_nan=False)) == content


def test_a_diagnosis_shows_verdict_steps_cards_and_notes():
    markup = DiagnosisResult(SAID, MODEL)._repr_html_()
    assert Page(markup).loaded() == []
    assert markup.startswith('<div class="snarelab-result"><style>')
    assert markup.endswith("</div>")
    assert '<span class="status">missing physics</span>\n<p>It is so &amp; so.</p>\n' in markup
    assert rows(markup)[0] == [
        ["as <given>", "12.3\u202f%", "50.0\u202f%"],
        ["+ one", "1.25\u202f%", "100\u202f%"],
    ]
    table = markup[: markup.index("</table>")]
    assert re.findall(r"<thead>.*</thead>", table) == [
        '<thead><tr><th scope="col">Model</th><th scope="col" class="n">Training</th>'
        '<th scope="col" class="n">Held-out</th></tr></thead>'
    ]
    assert '<div class="scroll"><table><caption>Relative misfit over all channels' in markup  # no wider than it must be
    assert re.findall(r"<summary>(.*?)</summary>", markup) == ["What is missing", "Why x at x", "Notes"]
    assert markup.index('<article class="card">') < markup.index("<summary>Notes")
    assert "<summary>Notes</summary>\n<p>first</p>\n<p>sec&lt;nd</p>\n</details>" in markup


def test_without_notes_there_is_nothing_to_fold():
    quiet = DiagnosisResult(replace(SAID, notes=()), MODEL)._repr_html_()
    assert re.findall(r"<summary>(.*?)</summary>", quiet) == ["What is missing", "Why x at x"]


KNOWN = ParameterEstimate("coulomb_friction", "joint1", "level", 1.23456789, 0.0123, "N*m", False, True)
IDENTIFIED = IdentificationResult(
    (
        KNOWN,
        replace(KNOWN, at="j<2>", name="some_shape", std=None, unit="N*m/rad**2", at_bound=True, identifiable=False),
        replace(KNOWN, value=-12345.678, std=0.5, identifiable=False),
    ),
    {
        "tau.joint1": {
            "unit": "N*m",
            "holdout": {"rms": 0.123456, "relative": 0.5},
            "train": {"rms": 2.0, "relative": 0.01234},
        },
        "tau.<2>": {"unit": "N", "train": {"rms": 1000.0, "relative": 1.0}},
    },
    123.456,
    MODEL,
    {"published": 1},
)


def test_an_identification_prints_parameters_misfits_and_condition():
    """Columns of 26, 16, 24, 12 and 11 letters."""
    lines = str(IDENTIFIED).split("\n")
    assert lines == [
        "effect                    at              parameter                      value        std  unit",
        "coulomb_friction          joint1          level                         1.2346      0.012  N·m",
        "coulomb_friction          j<2>            some_shape                    1.2346    unknown  N·m/rad²"
        "  (at its bound)",
        "coulomb_friction          joint1          level                         -12346        0.5  N·m",
        "tau.joint1 training: RMS residual 2 N·m, 1.23 % of the measured",
        "tau.joint1 held-out: RMS residual 0.1235 N·m, 50.0 % of the measured",
        "tau.<2> training: RMS residual 1000 N, 100 % of the measured",
        "condition number 123",
    ]
    assert repr(IDENTIFIED) == str(IDENTIFIED)
    assert IDENTIFIED.to_json() == {"published": 1}
    assert IDENTIFIED.to_json() is not IDENTIFIED.published


def test_an_identification_shows_its_parameters_with_a_remark_where_they_are_not_to_be_quoted():
    markup = IDENTIFIED._repr_html_()
    assert Page(markup).loaded() == []
    parameters, misfits = rows(markup)
    assert parameters == [
        ["Coulomb friction", "joint1", "level", "1.235", "± 0.012", "N·m", ""],
        ["Coulomb friction", "j<2>", "some shape", "1.235", "± –", "N·m/rad²", "at its bound"],
        ["Coulomb friction", "joint1", "level", "−12345.7", "± 0.5", "N·m", "not carried by the recordings"],
    ]
    assert misfits == [
        ["tau.joint1", "training", "2.00 N·m", "1.23\u202f%"],
        ["tau.joint1", "held-out", "0.123 N·m", "50.0\u202f%"],
        ["tau.<2>", "training", "1000 N", "100\u202f%"],
    ]
    assert re.findall(r'<th scope="col" class="n">(.*?)</th>', markup) == [
        "Value", "Std", "RMS residual", "Of the measured",
    ]  # fmt: skip
    assert '<div class="scroll wide">' not in markup
    assert "<caption>Parameters of arm&lt;6&gt;</caption>" in markup
    assert markup.endswith("<p>Condition number 123.</p>\n</div>")


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (DiagnosisResult(SAID, MODEL), f"It is so & so.\nsnarelab diagnose {__version__}"),
        (IDENTIFIED, f"arm<6>: values from snarelab identify {__version__}"),
    ],
)
def test_a_saved_model_says_where_it_comes_from(monkeypatch, result, said):
    seen = []
    monkeypatch.setattr(results, "save_model", lambda *given: seen.append(given))
    result.save_model("new.toml")
    assert seen == [(MODEL, "new.toml", said)]


def test_a_report_is_written_of_the_diagnosis(monkeypatch):
    seen = []
    monkeypatch.setattr(results, "write_report", lambda *given: seen.append(given))
    DiagnosisResult(SAID, MODEL).write_report("report.html")
    assert seen == [(SAID, "report.html")]


@pytest.mark.parametrize(("result", "name"), [(DiagnosisResult(SAID, MODEL), "model"), (IDENTIFIED, "condition")])
def test_a_result_cannot_be_changed(result, name):
    with pytest.raises(FrozenInstanceError):
        setattr(result, name, None)
    with pytest.raises(FrozenInstanceError):
        setattr(KNOWN, "value", 0.0)  # noqa: B010  what a type checker would refuse


def test_results_are_tables_and_pictures_too():
    found = DiagnosisResult(SAID, MODEL)
    table = found.to_frame()
    assert list(table.columns)[:4] == ["effect", "at", "probability", "parameter"]
    assert len(table) == sum(len(effect.parameters) for effect in SAID.effects)
    channel = SAID.traces[0].channel
    assert found.plot().svg == found.plot(channel).svg
    assert b"<svg" in found.plot().svg
    with pytest.raises(InputError, match=f"channel 'tau.none' was not recorded; there are {channel}"):
        found.plot("tau.none")
    parameters = IDENTIFIED.to_frame()
    assert parameters["at"].tolist() == ["joint1", "j<2>", "joint1"]
    assert parameters["value"].tolist()[0] == 1.23456789
