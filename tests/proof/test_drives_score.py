"""Scoring of the second proof: judged by hand-made answers, resumed, stopped at its limit, counted."""

import json
import time

import numpy as np
import pytest

from proof.drives import score as scoring
from proof.drives.judge import judge
from proof.drives.score import score, sources
from proof.drives.table import figures, read, table
from snarelab.errors import InputError

BACKGROUND = ["inertia_error", "presliding_hysteresis"]


def effect(name, at, probability=0.9, rivals=(), **values):
    parameters = {key: {"value": x, "std": std, "at_bound": False} for key, (x, std) in values.items()}
    others = [{"name": n, "at": a, "probability": p, "separable": s} for n, a, p, s in rivals]
    return {"name": name, "at": at, "probability": probability, "parameters": parameters, "rivals": others}


def line(group, concealed=(), said=(), verdict=None, kind="white", case="0000", seconds=1.0, **more):
    """What `score` writes of a case; ``concealed``: (name, at, size, values)."""
    truths = [
        {"name": n, "law": n or "a tooth", "at": at, "size": size, "channel": f"tau.joint{at[-1]}", "values": values}
        for n, at, size, values in concealed
    ]
    truth = {
        "group": group,
        "disturbance": {"kind": kind},
        "effects": truths,
        "background": BACKGROUND,
        "known": {"coulomb_friction.level": {"joint1": 2.0, "joint2": 1.0}},
    }
    verdict = verdict or ("missing_physics" if said else "adequate")
    return {"case": case, "verdict": verdict, "effects": list(said), "seconds": seconds, "truth": truth} | more


RIPPLE = ("torque_ripple", "joint2", 2.0, {})


def test_right_name_at_its_place():
    found = judge(line("single", [RIPPLE], [effect("torque_ripple", "joint2")]))
    assert found.whole
    assert (found.found[0].placed, found.found[0].credit) == (True, 1.0)
    assert found.told[0].first
    assert found.wrong == []


def test_link_and_sensor_are_places_of_their_joint():
    truth = ("sensor_gain", "tau.joint2", 1.0, {})
    found = judge(line("single", [truth], [effect("sensor_gain", "tau.joint2")]))
    assert found.found[0].placed
    assert not judge(line("single", [truth], [effect("sensor_gain", "tau.joint1")])).found[0].placed


def test_member_of_a_class_counts_half_and_one_that_can_be_told_apart_nothing():
    twin = effect("position_dependent_friction", "joint2", 0.6, [("torque_ripple", "joint2", 0.3, False)])
    found = judge(line("single", [RIPPLE], [twin]))
    assert (found.found[0].placed, found.found[0].member, found.found[0].credit) == (False, True, 0.5)
    assert found.told[0].probability == pytest.approx(0.9)
    assert found.whole
    assert not found.told[0].first
    apart = effect("position_dependent_friction", "joint2", 0.6, [("torque_ripple", "joint2", 0.3, True)])
    found = judge(line("single", [RIPPLE], [apart]))
    assert found.found[0].credit == 0.0
    assert [t.name for t in found.wrong] == ["position_dependent_friction"]
    assert not found.whole


def test_name_at_another_joint_is_wrong():
    found = judge(line("single", [RIPPLE], [effect("torque_ripple", "joint1")]))
    assert found.found[0].named
    assert not found.found[0].placed
    assert len(found.wrong) == 1


def test_what_the_background_has_is_neither_right_nor_wrong():
    found = judge(line("clean", (), [effect("presliding_hysteresis", "joint1"), effect("sensor_drift", "tau.joint1")]))
    assert [t.background for t in found.told] == [True, False]
    assert [t.name for t in found.wrong] == ["sensor_drift"]


def test_unknown_is_the_right_answer_to_a_law_without_a_name():
    truth = ("", "joint2", 4.0, {})
    found = judge(line("nameless", [truth], verdict="unknown_effect", location={"tau.joint1": 0.1, "tau.joint2": 0.8}))
    assert found.unknown
    assert found.located
    assert not judge(line("nameless", [truth], [effect("torque_ripple", "joint2")])).unknown
    # Names that are true of the background do not hide what is told beside them, on the law's own channel.
    beside = line("nameless", [truth], [effect("presliding_hysteresis", "joint1")])
    assert judge(beside | {"description": "on tau.joint2, a smooth curve over position"}).unknown
    assert not judge(beside | {"description": "on tau.joint1, a smooth curve over position"}).unknown
    assert judge(beside | {"description": "on tau.joint1, a smooth curve over position"}).nameless
    assert not judge(line("nameless", [truth], verdict="unknown_effect", location={"tau.joint1": 0.9})).located


def test_values_are_in_deviations():
    truth = ("rotor_inertia", "joint1", 1.0, {"inertia": 2.0})
    found = judge(line("single", [truth], [effect("rotor_inertia", "joint1", inertia=(2.6, 0.2))]))
    assert found.found[0].deviations == pytest.approx([3.0])
    moved = [{"name": "coulomb_friction.joint1.level", "after": 2.3, "std": 0.1}, {"name": "x", "after": 1, "std": 1}]
    assert judge(line("clean", moved=moved)).known == pytest.approx([3.0])
    assert judge(line("single", [truth], moved=moved)).known == ()


def by_name(lines):
    return {f.name: f for f in figures([judge(x) for x in lines])}


def test_figures_count_what_they_say():
    good, bad = effect("torque_ripple", "joint2", 0.8), effect("sensor_drift", "tau.joint1", 0.6)
    found = by_name(
        [
            line("clean"),
            line("clean", (), [bad], kind="wandering"),
            line("clean", (), [effect("inertia_error", "link1")], kind="coloured", seconds=5.0),
            line("single", [RIPPLE], [good]),
            line("single", [RIPPLE], [good, bad], kind="wandering", seconds=3.0),
            line("single", [("torque_ripple", "joint1", 0.5, {})], []),
            line("nameless", [("", "joint1", 2.0, {})], verdict="unknown_effect", location={"tau.joint1": 1.0}),
            line("single", [RIPPLE], verdict="out of time"),
        ]
    )
    expected = {
        "clean: a false name": (1 / 3, 3),
        "clean, wandering: a false name": (1.0, 1),
        "clean, white: a false name": (0.0, 1),
        "wandering, all groups: a false name": (1.0, 2),
        "clean: any name at all, also those true of the background": (2 / 3, 3),
        "single 0.5x: its name at its place": (0.0, 1),
        "single 2x: its name at its place": (2 / 3, 3),
        "single 2x: told, and nothing wrong besides": (1 / 3, 3),
        "place right, of names that are told": (1.0, 2),
        "wrong names a case": (2 / 8, 8),
        "wrong names a case, those true of the background too": (3 / 8, 8),
        "laws without a name: told as unknown": (1.0, 1),
        "laws without a name: told as unknown, loudest at its channel": (1.0, 1),
        "Brier score of names told": ((2 * 0.2**2 + 2 * 0.6**2) / 4, 4),
        "Brier skill of names told": (1.0 - 0.2 / 0.25, 4),
        "no answer: failed or out of time": (1 / 8, 8),
        "median seconds": (1.0, 8),
        "most seconds": (5.0, 8),
    }
    for name, (value, count) in expected.items():
        assert found[name].value == pytest.approx(value), name
        assert found[name].count == count, name
    assert found["single 4x: its name at its place"].value is None


def test_closure_is_the_share_of_the_way_to_the_twin():
    third = {"tau.joint1": [9.0, 9.0, 1.0], "tau.joint2": [3.0, 1.5, 1.0]}
    assert judge(line("single", [RIPPLE], third=third)).closure == pytest.approx(0.75)
    assert judge(line("single", [RIPPLE], third={"tau.joint2": [1.01, 1.0, 1.0]})).closure == 1.0
    assert judge(line("single", [RIPPLE], third={"tau.joint2": [1.01, 1.1, 1.0]})).closure == 0.0
    assert judge(line("single", [RIPPLE])).closure is None
    two = [RIPPLE, ("viscous_friction", "joint1", 2.0, {})]
    scaled = {"tau.joint1": [30.0, 10.0, 10.0], "tau.joint2": [3.0, 1.0, 1.0]}
    assert judge(line("pair", two, third=scaled)).closure == pytest.approx(1.0)


def test_parameters_and_sensors_are_not_physics():
    bias, mass = effect("sensor_bias", "tau.joint2"), effect("payload_mass", "link2")
    ripple = effect("torque_ripple", "joint2")
    unsure = effect("torque_ripple", "joint2", 0.5, [("sensor_bias", "tau.joint2", 0.4, False)])
    fault = line("single", [("sensor_bias", "tau.joint2", 1.0, {})])
    assert judge(fault).fault
    assert judge(line("wrong")).fault
    assert not judge(line("single", [RIPPLE])).fault
    assert not judge(line("nameless", [("", "joint2", 1.0, {})])).fault
    bristles = effect("presliding_hysteresis", "joint1")  # which the background has
    for said, blamed in ((bristles, False), (bias, False), (mass, False), (ripple, True), (unsure, False)):
        assert judge(fault | {"effects": [said], "verdict": "missing_physics"}).blamed == blamed
    assert judge(fault | {"verdict": "unknown_effect"}).blamed
    found = by_name([fault, line("wrong", (), [ripple])])
    assert found["a parameter or a sensor is wrong: physics not blamed"].value == 0.5


def test_more_than_two_at_once_are_counted_apart():
    two = [RIPPLE, ("viscous_friction", "joint1", 2.0, {})]
    three = [*two, ("sensor_bias", "tau.joint3", 1.0, {})]
    said = [effect(name, at) for name, at, *_ in three]
    found = by_name([line("pair", two, said[:2]), line("pair", three, said[:2]), line("pair", three, said)])
    assert found["pairs: both told, and nothing wrong besides"].value == 1.0
    assert found["three and four at once: all told, and nothing wrong besides"].value == 0.5
    assert found["pairs and more: effects named at their place"].value == pytest.approx(7 / 8)


@pytest.fixture
def folders(tmp_path):
    made = [tmp_path / f"{k:04}" for k in range(3)]
    for folder in made:
        folder.mkdir()
        (folder / "truth.json").write_text(json.dumps(line("clean")["truth"]))
    return made


def answer(**more):
    return {"verdict": "adequate", "effects": []} | more


def test_score_resumes_and_asks_again_when_sources_or_truths_change(tmp_path, folders, monkeypatch):
    out, asked = tmp_path / "said.jsonl", []

    def run(folder):
        asked.append(folder.name)
        return answer()

    score(folders[:2], out, tell=lambda _: None, run=run)
    score(folders, out, tell=lambda _: None, run=run)
    assert asked == ["0000", "0001", "0002"]
    assert [json.loads(x)["case"] for x in out.read_text().splitlines()] == asked
    (folders[1] / "truth.json").write_text(json.dumps(line("clean", kind="wandering")["truth"]))
    score(folders, out, tell=lambda _: None, run=run)
    assert asked[3:] == ["0001"]
    monkeypatch.setattr(scoring, "sources", lambda: "others")
    score(folders, out, tell=lambda _: None, run=run)
    assert asked[4:] == ["0000", "0001", "0002"]
    assert len(read(out)) == 3
    assert "median seconds" in table(read(out))


def test_answers_hold_for_truths_that_another_processor_drew(tmp_path, folders):
    """The last digits of what was drawn differ; a run goes on there."""
    out, asked = tmp_path / "said.jsonl", []

    def run(folder):
        asked.append(folder.name)
        return answer()

    drawn = json.loads((folders[0] / "truth.json").read_text())
    for level in (0.3, 0.1 + 0.2, 0.3001):
        (folders[0] / "truth.json").write_text(json.dumps(drawn | {"known": {"level": [level]}}))
        score(folders[:1], out, tell=lambda _: None, run=run)
    assert asked == ["0000", "0000"]


def test_no_answer_counts_as_none(tmp_path, folders):
    def fails(folder):
        raise InputError("tau.joint1 is missing")

    def lasts(folder):
        try:
            while True:
                time.sleep(0.01)
        except Exception:  # an answer may well catch what goes wrong on its way
            return answer()

    failed = score(folders[:1], tmp_path / "a.jsonl", tell=lambda _: None, run=fails)
    late = score(folders[:1], tmp_path / "b.jsonl", 0.2, tell=lambda _: None, run=lasts)
    hung = score(folders[:1], tmp_path / "c.jsonl", 0.2, tell=lambda _: None, run=lambda _: time.sleep(9.0) or answer())
    slow = score(folders[:1], tmp_path / "d.jsonl", 0.2, tell=lambda _: None, run=lambda _: time.sleep(0.4) or answer())
    said = [x[0]["verdict"] for x in (failed, late, hung, slow)]
    assert said == ["failed", "out of time", "out of time", "adequate"]
    assert late[0]["seconds"] < 2.0
    assert 0.5 < hung[0]["seconds"] < 9.0
    assert failed[0]["notes"] == ["tau.joint1 is missing"]


def test_an_effect_is_kept_as_the_tool_says_it(tmp_path, folders):
    told = effect("torque_ripple", "joint2", 0.8, [("x", "joint2", 0.1, False)], period=(0.2, 0.01))
    fit = {"tau.joint2": {part: {"rms_before": 2.0, "rms_after": 1.0} for part in ("train", "holdout")}}
    location = [{"channel": "tau.joint2", "share": 0.7}]
    told |= {"margin": 2.5, "gain": 30.0}
    said = answer(verdict="missing_physics", effects=[{**told, "evidence": "x"}], fit=fit, location=location)
    kept = score(folders[:1], tmp_path / "a.jsonl", tell=lambda _: None, run=lambda _: said)[0]
    assert kept["effects"] == [told]
    assert kept["location"] == {"tau.joint2": 0.7}
    assert kept["fit"] == {"tau.joint2": [2.0, 1.0, 2.0, 1.0]}


def test_third_recording_is_scored_with_the_model_that_was_found(tmp_path, folders, monkeypatch):
    asked = []

    def closing(folder, model, band):
        asked.append((folder, model.exists(), band))
        return {"tau.joint2": [3.0, 1.0, 1.0]}

    def run(folder):
        (folder / scoring.FOUND).touch()
        return answer(band={"value": 12.0})

    monkeypatch.setattr(scoring, "closing", closing)
    (folders[1] / "twin").mkdir()
    (folders[1] / scoring.FOUND).touch()  # of an earlier tool
    kept = score(folders[:2], tmp_path / "a.jsonl", tell=lambda _: None, run=run)
    assert ["third" in x for x in kept] == [False, True]
    score(folders[1:2], tmp_path / "b.jsonl", tell=lambda _: None, run=lambda _: answer())
    assert asked == [(folders[1], True, 12.0), (folders[1], False, scoring.BAND)]


def test_sources_are_a_digest_of_the_tool():
    assert sources() == sources()
    assert len(sources()) == 64
    assert np.all([c in "0123456789abcdef" for c in sources()])


def test_law_that_has_a_name_by_now_is_told_by_it_and_as_unknown():
    lawless = line("nameless", [("", "joint2", 2.0, {})], [effect("gear_efficiency", "joint2")])
    lawless["truth"]["effects"][0]["law"] = "gear that costs only when it drives"
    found = judge(lawless)
    assert found.unknown
    assert found.wrong == []
    elsewhere = lawless | {"effects": [effect("gear_efficiency", "joint1")]}
    assert not judge(elsewhere).unknown
    assert [t.at for t in judge(elsewhere).wrong] == ["joint1"]
    assert judge(lawless | {"effects": [], "verdict": "unknown_effect"}).unknown
