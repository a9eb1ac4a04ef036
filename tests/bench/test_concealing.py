"""What benches that conceal effects share: a run that was broken off goes on, and the table counts."""

import json

import pytest

from bench.concealing import main, table

EFFECTS = ("rubs", "clean")


def line(row):
    return f"{row['effect']} {row['seed']}"


def test_cases_that_are_done_are_not_done_again(tmp_path, capsys):
    done = []

    def run_case(effect, seed, folder):
        if (effect, seed) == ("rubs", 2):
            raise KeyboardInterrupt
        done.append((effect, seed))
        return {"effect": effect, "seed": seed, "right": effect == "clean"}

    def again(effect, seed, folder):
        done.append((effect, seed))
        return {"effect": effect, "seed": seed, "right": True}

    out = tmp_path / "cases.jsonl"
    words = ["--seeds", "1", "2", "--out", str(out)]
    with pytest.raises(KeyboardInterrupt):
        main("", EFFECTS, run_case, lambda *_: None, line, out, words)
    assert [json.loads(text)["effect"] for text in out.read_text().splitlines()] == ["rubs", "clean"]
    assert main("", EFFECTS, again, lambda *_: None, line, out, words) == 0
    assert done == [("rubs", 1), ("clean", 1), ("rubs", 2), ("clean", 2)]
    assert capsys.readouterr().out.splitlines()[-6:] == [
        "rubs 1", "rubs 2", "clean 1", "clean 2", "rubs: 1 of 2", "clean: 2 of 2",
    ]  # fmt: skip


def test_recordings_alone_leave_no_case(tmp_path):
    made = []
    words = ["--record", "--only", "rubs", "--seeds", "3", "--keep", str(tmp_path / "kept"), "--out", f"{tmp_path}/x"]
    assert main("", EFFECTS, lambda *_: {}, lambda *given: made.append(given), line, tmp_path / "y", words) == 0
    assert made == [("rubs", 3, tmp_path / "kept")]
    assert not (tmp_path / "x").exists()


def test_the_table_is_in_the_effects_order():
    rows = [{"effect": e, "seed": s, "right": s == 1} for e in ("clean", "rubs") for s in (2, 1)]
    assert table(rows, EFFECTS, line).splitlines()[:3] == ["rubs 1", "rubs 2", "clean 1"]
    assert table(rows[:1], EFFECTS, line).splitlines() == ["clean 2", "clean: 0 of 1"]
