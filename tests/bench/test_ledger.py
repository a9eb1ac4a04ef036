"""The ledger: asked once for the same sources, differences told, and the kept one whole."""

import json

import pytest

from bench.ledger import KEPT, asked, moved, row, summary
from bench.ledger_cases import Entry, entries
from snarelab.errors import InputError


def said(verdict="missing_physics", effects=(), held_out=(0.2, 0.1), **more):
    return {"concealed": "", "verdict": verdict, "effects": list(effects), "held_out": list(held_out), **more}


def named(name="coulomb_friction", at="joint1", probability=0.9, level=2.0, twins=()):
    values = {"level": [level, 0.1]}
    return {"name": name, "at": at, "probability": probability, "values": values, "not_told_apart": list(twins)}


def entry(key, calls, answer=None, fails=False):
    def ask(folder):
        assert folder.is_dir()
        calls.append(key)
        if fails:
            raise InputError("recording not found")
        return answer or said()

    return Entry(key, "", ask)


def test_answers_are_asked_for_once(tmp_path):
    calls, state, quiet = [], tmp_path / "ledger.jsonl", lambda _: None
    some = [entry("a", calls), entry("b", calls)]
    asked(some[:1], state, "v1", tell=quiet)
    found = asked(some, state, "v1", tell=quiet)
    assert calls == ["a", "b"]
    assert set(found) == {"a", "b"}
    asked(some, state, "v2", tell=quiet)
    assert calls == ["a", "b", "a", "b"]
    assert set(asked(some[:1], state, "v2", tell=quiet)) == {"a"}


def test_stops_in_time_and_tells_what_is_missing(tmp_path):
    calls, words = [], []
    some = [entry("gone", calls, fails=True), entry("a", calls)]
    assert set(asked(some, tmp_path / "x.jsonl", "v", tell=words.append)) == {"a"}
    assert "gone: cannot be asked: recording not found" in words[0]
    assert asked([entry("b", calls)], tmp_path / "x.jsonl", "v", most=-1.0, tell=words.append) == {}
    assert "1 entries left" in words[-1]


def test_moved_tells_each_difference():
    old = {"a": said(effects=[named(), named("sensor_bias", "tau.joint1")]), "gone": said(), "same": said()}
    new = {
        "a": said("adequate", [named(probability=0.7, level=3.0, twins=["x at joint1"]), named("stribeck_friction")]),
        "same": said(effects=[], held_out=(0.2, 0.1001)),
        "late": said(),
    }
    assert moved(old, old) == []
    assert moved(old, new) == [
        "gone: only in the old ledger",
        "late: new",
        "a: missing_physics -> adequate",
        "a: no longer sensor_bias at tau.joint1",
        "a: now stribeck_friction at joint1, 0.90",
        "a: coulomb_friction at joint1: probability 0.90 -> 0.70",
        "a: coulomb_friction at joint1: level 2 -> 3",
        "a: coulomb_friction at joint1: not told apart from nothing -> x at joint1",
    ]
    assert moved({"a": said()}, {"a": said(held_out=(0.2, 0.11))}) == ["a: held-out error 10.00 -> 11.00 %"]
    assert moved({"a": said()}, {"a": said(held_out=(None, None))}) == []
    other = said() | {"concealed": "x"}
    assert moved({"a": said()}, {"a": other}) == ["a: another case; the two cannot be compared"]


def test_moved_sees_the_encoders_error():
    old, new = said(held_out_mdeg={"q_link.axis1": 2.3}), said(held_out_mdeg={"q_link.axis1": 2.6})
    assert moved({"kuka": old}, {"kuka": new}) == ["kuka: held-out q_link.axis1 2.3 -> 2.6 mdeg"]


def test_rows_and_summary():
    answers = {"rig/none-1": said(seconds=2.0), "rig/none-2": said("adequate", seconds=3.0), "bam": said(seconds=1.0)}
    assert "missing_physics: - (20.00 -> 10.00 %)" in row("rig/none-1", answers["rig/none-1"])
    lines = summary(answers).splitlines()
    assert [x.split() for x in lines[1:]] == [["rig", "2", "1", "0", "0", "5"], ["bam", "1", "0", "0", "0", "1"]]


def test_keys_are_distinct():
    for cases, slow in ((0, False), (12, True)):
        keys = [e.key for e in entries(cases, slow)]
        assert len(set(keys)) == len(keys)
    assert len(entries(12, True)) == len(entries(12, False)) + 24


def test_kept_ledger_is_whole():
    kept = json.loads(KEPT.read_text(encoding="utf-8"))["entries"]
    assert list(kept) == [e.key for e in entries(12, False)]
    for e in entries(12, False):
        assert kept[e.key]["concealed"] == e.concealed
    assert kept["emps/viscous"]["held_out"] == pytest.approx([0.1774, 0.0263], abs=0.02)
    assert kept["bundled"]["effects"]
