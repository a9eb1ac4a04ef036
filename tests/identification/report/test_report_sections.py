"""The report's sections, told from small invented diagnoses: rows, order, marks and words, each counted by hand."""

import re
from dataclasses import replace
from datetime import date

from diagnoses import spelt
from report_by_hand import diagnosis, heads, rows, trace

from snarelab.identification.diagnosis import (
    Candidate,
    ChannelFit,
    Estimate,
    Finding,
    Limit,
    Location,
    Misfit,
    ParameterShift,
    Rival,
    Step,
)
from snarelab.identification.report import findings, fit

MISFIT = ChannelFit("a", "N*m", Misfit(4, 3, 0.4, 0.3), Misfit(8, 2, 0.8, 0.2), 0.125)


def test_the_misfits_stand_in_one_row_a_channel():
    content = fit._misfits(diagnosis(fit=(MISFIT, replace(MISFIT, channel="<b>", unit="N"))), True)
    assert heads(content) == [
        "Channel",
        "RMS, training, before",
        "RMS, training, after",
        "RMS, held-out, before",
        "RMS, held-out, after",
        "Noise floor",
        "Relative, held-out, before",
        "Relative, held-out, after",
    ]
    cells = ["4.00", "3.00", "8.00", "2.00", "0.125", "80.0\u202f%", "20.0\u202f%"]
    assert rows(content) == [["a\u00a0[N·m]", *cells], ["<b>\u00a0[N]", *cells]]
    assert re.findall(r'<th scope="row"( class="n")?', content) == ["", ""]
    assert len(re.findall(r'<td class="n"', content)) == 14


def test_without_an_addition_the_misfits_are_those_of_the_one_model():
    content = fit._misfits(diagnosis(fit=(MISFIT,)), False)
    assert heads(content) == ["Channel", "RMS, training", "RMS, held-out", "Noise floor", "Relative, held-out"]
    assert rows(content) == [["a\u00a0[N·m]", "4.00", "8.00", "0.125", "80.0\u202f%"]]


def test_steps_are_drawn_from_the_second_on(asked):
    two = (Step("as <given>", 0.5, 0.25), Step("+ one", 0.125, 0.2), Step("+ two", 0.0625, 0.1))
    key, title, content = fit.step_by_step(diagnosis(steps=two))
    assert (key, title) == ("steps", "Step by step")
    assert rows(content)[0] == ["as <given>", "50.0\u202f%", "25.0\u202f%"]
    assert rows(content)[2] == ["+ two", "6.25\u202f%", "10.0\u202f%"]
    assert re.findall(r'alt="([^"]*)', content) == [
        "Relative misfit by step; on the held-out recording from 25.0 % to 10.0 %."
    ]
    assert asked == [(two,)]
    assert "<figure>" not in fit.step_by_step(diagnosis(steps=two[:1]))[2]


def test_the_residuals_shape_is_drawn_channel_by_channel(asked):
    kept = (trace("a", 2, 2), trace("b", 2, 1), trace("b", 2, 1.9, recording="c.csv"), trace("b", 2, 1, "train"))
    content = fit.shape(diagnosis(traces=kept, effects=spelt("x").effects))[2]
    assert [([(t.channel, t.recording) for t in shown], changed) for shown, changed in asked] == [
        ([("b", "b.csv"), ("b", "c.csv")], True),
        ([("a", "b.csv")], False),
    ]
    assert re.findall(r'alt="([^"]*)', content) == [
        "b: residual before and after against speed and position.",
        "a: residual against speed and position.",
    ]
    captions = re.findall(r"<figcaption>([^<]*)", content)
    assert captions[0].startswith("b, held-out. Line: mean")
    assert captions[1].startswith("a, held-out. The model before and after are alike here. Line")


def test_a_channel_without_position_or_speed_has_no_shape(monkeypatch):
    monkeypatch.setattr(fit, "residual_curves", lambda traces, _: None if traces[0].channel == "a" else b"<svg/>")
    none, some = (trace("a", 2, 1),), (trace("a", 2, 1), trace("b", 2, 1))
    assert fit.shape(diagnosis(traces=none))[2] == "<p>No channel has a position or speed to draw against.</p>\n"
    assert re.findall(r'alt="([^:]*)', fit.shape(diagnosis(traces=some))[2]) == ["b"]


def test_the_fifteen_best_candidates_are_drawn_and_all_stand_in_the_table(asked):
    pool = tuple(Candidate("backlash", f"joint{i}", i / 64, 2.0 * i, i in (3, 15)) for i in range(17))
    content = fit.screened(diagnosis(candidates=pool))[2]
    ((top,),) = asked
    assert [row.at for row in top] == [f"joint{i}" for i in range(16, 1, -1)]
    assert re.findall(r'alt="([^"]*)', content) == [
        "Share of residual energy explained by each of the best 15 candidates; named in the end: backlash at joint15, "
        "backlash at joint3."
    ]
    assert "so the shares do not add up: a candidate that explains much may only imitate" in content
    assert "All 17 candidates as a table" in content
    assert rows(content)[15:] == [
        ["backlash", "joint15", "23.4\u202f%", "30.0", "named"],
        ["backlash", "joint16", "25.0\u202f%", "32.0", ""],
    ]


def test_where_no_candidate_was_named_or_tried_it_says_so(asked):
    one = Candidate("backlash", "joint1", 0.25, 8.0, False)
    content = fit.screened(diagnosis(candidates=(one,)))[2]
    assert "each of the best 1 candidates; none was named." in content
    assert "so the shares do not add up.</figcaption>" in content
    none = fit.screened(diagnosis())[2]
    assert none == "<p>No candidate was tried: the residual gave no reason for one.</p>\n"
    assert len(asked) == 1


def test_a_parameter_is_marked_where_it_moved_by_over_two_deviations():
    """Steps of a quarter, and a deviation of an eighth."""
    kept = [
        ParameterShift(f"m{i}", "N*m" if i else "", 1.0, after, 0.125)
        for i, after in enumerate((1.25, 0.75, 1.26, 0.74))
    ]
    content = fit.parameters(diagnosis(moved=tuple(kept)))[2]
    assert rows(content) == [
        ["m0", "1.00", "1.25", "± 0.12", "–", ""],
        ["m1", "1.00", "0.75", "± 0.12", "N·m", ""],
        ["m2", "1.00", "1.26", "± 0.12", "N·m", "moved"],
        ["m3", "1.00", "0.74", "± 0.12", "N·m", "moved"],
    ]
    assert fit.parameters(diagnosis())[2] == "<p>None: no physics was added to the baseline.</p>\n"


LIMIT = Limit("coulomb_friction", "joint1", "level", 0.5, "N*m")


def test_notes_close_with_the_limits_of_detection_unless_these_were_shown():
    said = diagnosis(notes=("a < b", "c"), limits=(LIMIT,))
    items = "<ul><li>a &lt; b</li>\n<li>c</li>\n</ul>\n"
    key, heading, content = fit.notes(said)
    assert (key, heading) == ("notes", "Notes")
    assert content.startswith(items + "<details><summary>")
    assert content.endswith(findings.detection_limits(said) + "</details>\n")
    none = replace(said, limits=())
    assert fit.notes(none)[2] == items + findings.detection_limits(none)
    assert fit.notes(replace(said, verdict="adequate"))[2] == items
    quiet = fit.notes(diagnosis(verdict="adequate"))[2]
    assert quiet == "<p>No remarks on conditioning or excitation.</p>\n"


def test_limits_name_the_place_that_shows_an_effect_best_and_worst():
    """One row for each effect, parameter and unit."""
    limits = [replace(LIMIT, at=f"joint{i}", value=x) for i, x in enumerate((0.3, 0.1, 0.5))]
    limits += [replace(LIMIT, unit="N", at="slide"), replace(LIMIT, parameter="b_c", unit="", at="x", value=2.0)]
    assert rows(findings.detection_limits(diagnosis(limits=tuple(limits)))) == [
        ["Coulomb friction", "level", "0.100 N·m at joint1", "0.500 N·m at joint2"],
        ["Coulomb friction", "level", "0.500 N at slide", "0.500 N at slide"],
        ["Coulomb friction", "b c", "2.00 at x", "2.00 at x"],
    ]
    none = "<p>No limits of detection were computed for these recordings.</p>\n"
    assert findings.detection_limits(diagnosis()) == none


def test_the_verdict_stands_on_recordings_that_are_named_once():
    kept = [trace(c, 1, 1, "train", recording=r) for r in ("b.csv", "a.csv") for c in ("x", "y")]
    said = diagnosis(traces=(*kept, trace("x", 1, 1, recording="<h>.csv")), model="arm", band=12.5)
    content = findings.verdict(said, date(2024, 2, 29))
    assert re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", content) == [
        ("Model", "arm"),
        ("Training", "b.csv, a.csv"),
        ("Held-out", "&lt;h&gt;.csv"),
        ("Analysis band", "0 to 12.5 Hz"),
        ("Date", "2024-02-29"),
    ]
    assert content.startswith('<span class="status missing_physics">missing physics</span>\n<h1>x</h1>')
    alone = findings.verdict(replace(said, traces=tuple(kept)), date(2024, 2, 29))
    assert "Held-out" not in alone  # what is empty is left out


def test_where_draws_the_four_worst_channels_in_order_from_the_first_recording_fitted(asked):
    kept = [trace(c, 1, 1, role, recording=r) for r, role in (("h", "holdout"), ("1", "train"), ("2", "train"))
            for c in "abcdef"]  # fmt: skip
    shares = (("a", 0.05), ("b", 0.3), ("c", 0.2), ("b", 0.01), ("z", 0.25), ("d", 0.1), ("e", 0.09))
    places = tuple(Location(c, x, ((1.0, 2.0),) if c == "a" else (), "up" if c == "a" else "") for c, x in shares)
    key, title, content = findings.where(diagnosis(traces=tuple(kept), location=places))
    assert (key, title) == ("where", "Where")
    ((first, given),) = asked
    assert [(t.channel, t.recording) for t in first] == [("b", "1"), ("c", "1"), ("d", "1"), ("e", "1")]
    assert given == places
    assert rows(content)[:2] == [["a", "5.00\u202f%", "1.0–2.0 s", "up"], ["b", "30.0\u202f%", "–", "–"]]
    assert "with the table&#x27;s windows shaded: b, c, d, e." in content
    assert "<figure>" not in findings.where(diagnosis(location=places))[2]
    assert findings.where(diagnosis())[2] == "<p>No channel, time or state stands out in the residual.</p>\n"


def test_a_place_has_one_table_with_evidence_and_rivals_folded():
    estimates = {"level": Estimate(7.0123, 0.0432, "N*m"), "shape_of_it": Estimate(2.0, 0.5, "", at_bound=True)}
    first = Finding("coulomb_friction", "joint<1>", 0.5, 0.87, estimates, "Seen.", ())
    bare = Finding("x", "tau.joint<1>", 0.5, 0.5, {}, "", (Rival("backlash", "j", 0.25, True, ""),))
    content = findings._card("joint<1>", [first, bare])
    assert "<h3>joint&lt;1&gt;</h3>" in content
    assert heads(content)[:6] == ["Effect", "Probability", "Parameter", "Value", "Deviation", "Unit"]
    assert rows(content) == [
        ["Coulomb friction at joint<1>", "87\u202f%", "level", "7.01", "± 0.04", "N·m", ""],
        ["", "", "shape of it", "2.0", "± 0.5", "–", "at its bound"],
        ["X at tau.joint<1>", "50\u202f%", "", "–", "–", "–", ""],
        ["backlash at j", "25\u202f%", "these recordings tell them apart", "–"],
    ]
    assert re.findall(r"<summary>(.*?)</summary>", content) == [
        "Why Coulomb friction at joint&lt;1&gt;",
        "Why x at tau.joint&lt;1&gt;",
    ]
    assert "<p>Seen.</p>\n" in content
    assert '<p class="quiet">No rival explanation is left.</p>' in content


def test_findings_stand_together_by_place_with_the_sensors_of_a_joint():
    one = Finding("backlash", "a", 0.5, 0.5, {}, "", ())
    kept = [one, replace(one, at="b"), replace(one, name="sensor_bias", at="tau.a"), replace(one, at="boom1.twist")]
    groups = findings._by_place(kept)
    assert {place: [f.at for f in group] for place, group in groups.items()} == {
        "a": ["a", "tau.a"], "b": ["b"], "boom1.twist": ["boom1.twist"],
    }  # fmt: skip


def test_what_is_said_of_missing_physics_goes_with_the_verdict():
    said = diagnosis(verdict="unknown_effect", description="a < b", limits=(LIMIT,), effects=spelt("x").effects)
    card = '<article class="card"><p>a &lt; b</p>\n</article>\n'
    assert findings.missing(said) == ("missing", "What is known about it", card)
    adequate = replace(said, verdict="adequate")
    assert findings.missing(adequate) == ("missing", "What would have been seen", findings.detection_limits(said))
    named = replace(said, verdict="missing_physics", description="")
    assert findings.missing(named) == ("missing", "What is missing", findings._card("x", said.effects))
