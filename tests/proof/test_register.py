"""Registered runs: what is committed before, what of a tree differs, runs by the hour, figures beside their bars."""

import json

import pytest

from proof import register
from proof.bars_table import table
from proof.register import BARS, differences, now, printed, result, run
from proof.register import register as registered
from proof.register_command import main
from proof.seal import CASES, ROOT, digest

SEEDS = {"drives": [500, 501], "played": [600]}


def written(cases=2):
    """As it is read back from the file."""
    return json.loads(json.dumps(registered(SEEDS, cases, today="2026-01-01", commit="0" * 40)))


def answers(path, truth, **said):
    line = {"verdict": "adequate", "effects": [], "seconds": 1.0, "location": {}} | said
    return {"case": path.name, "version": register.sources(), **line, "truth": truth}


@pytest.fixture
def drawn(monkeypatch):
    """Generators that draw folders with a truth and nothing else, and a tool that says they are adequate."""
    truth = {
        "group": "clean",
        "disturbance": {"kind": "white"},
        "effects": [],
        "background": [],
        "known": {},
    }

    def make(folder, seed, count, tell=print, first=0):
        paths = [folder / f"{k:04}" for k in range(first, count)]
        for path in paths:
            path.mkdir(parents=True, exist_ok=True)
            (path / "truth.json").write_text(json.dumps(truth))
        return paths

    monkeypatch.setattr(register, "GENERATORS", {"drives": make, "played": make})
    monkeypatch.setattr(register, "code", lambda name: name)
    asked = []

    def score(folders, out, limit, tell):
        out.parent.mkdir(parents=True, exist_ok=True)
        asked.append((out.name, folders[0].name))
        with out.open("a") as file:
            file.write(json.dumps(answers(folders[0], truth)) + "\n")

    monkeypatch.setattr(register, "score", score)
    return asked


def test_tree_is_the_registered_one_until_something_changes():
    assert differences(written()) == []
    other = written() | {"tool": "0" * 64}
    assert differences(other) == ["the tool's sources are not those registered at 000000000000"]
    other = written()
    other["generators"]["played"] = "0" * 64
    assert differences(other) == ["the sources of the generator played are not those registered"]
    other = written()
    other["bars"]["clean: a false name"][0] = 0.5
    assert differences(other) == ["the bars are not those registered"]


def test_every_bar_is_held_to_a_figure_that_there_is():
    from proof.drives.table import figures

    assert set(BARS) <= {f.name for f in figures([])}


def test_run_of_another_tree_is_refused(tmp_path):
    with pytest.raises(ValueError, match="the tool's sources are not those registered"):
        run(written() | {"tool": "0" * 64}, 1.0, print, tmp_path)


def test_run_goes_through_generators_in_turns_and_ends_with_its_time(drawn, tmp_path):
    time = iter(range(0, 100_000, 1000))
    files = run(written(), 1.0, lambda _: None, tmp_path, tmp_path / "answers", clock=lambda: next(time))
    # The first look at the clock starts it; 3600 s are three more.
    assert drawn == [("drives-500.jsonl", "0000"), ("drives-501.jsonl", "0000"), ("played-600.jsonl", "0000")]
    assert len(files["drives"].read_text().splitlines()) == 2
    numbers = result(written(), files)
    clean = numbers["generators"]["drives"]["clean: a false name"]
    assert (clean["value"], clean["cases"], clean["bar"], clean["met"]) == (0.0, 2, 0.02, True)
    assert numbers["generators"]["played"]["pairs: both told, and nothing wrong besides"]["met"] is None
    assert "bar" not in numbers["generators"]["drives"]["median seconds"]
    assert printed(files).startswith("drives\n")
    assert not (tmp_path / "drives/500/0001").exists()
    # Elsewhere it goes on: what is answered is not drawn again.
    run(written(), 1.0, lambda _: None, tmp_path / "elsewhere", tmp_path / "answers", clock=lambda: 0.0)
    assert drawn[3:] == [("drives-500.jsonl", "0001"), ("drives-501.jsonl", "0001"), ("played-600.jsonl", "0001")]
    assert not (tmp_path / "elsewhere/drives/500/0000").exists()


def test_figures_stand_beside_their_bars_and_those_that_miss_are_bold():
    def figure(value, cases, met, interval=(0.0, 1.0)):
        return {"value": value, "cases": cases, "met": met, "interval": interval}

    found = {
        "registered": {"bars": {"seen": [0.9, "at least"], "calibration": [0.05, "at most"]}},
        "generators": {
            "drives": {"seen": figure(0.875, 8, False), "calibration": figure(0.031, 20, True, None)},
            "played": {"seen": figure(None, 0, None, None), "calibration": figure(0.06, 4, False, None)},
        },
    }
    assert table(found).splitlines() == [
        "| figure | bar | `drives` | `played` |",
        "| --- | ---: | ---: | ---: |",
        "| seen | ≥ 90 % | **88 % of 8** | – |",
        "| calibration | ≤ 0.05 | 0.03 | **0.06** |",
    ]


def test_one_generator_can_run_alone(drawn, tmp_path):
    files = run(written(), 1.0, lambda _: None, tmp_path, tmp_path / "answers", clock=lambda: 0.0, only="played")
    assert {name for name, _ in drawn} == {"played-600.jsonl"}
    assert list(files) == ["played"]


@pytest.mark.parametrize(
    ("seeds", "cases", "message"),
    [
        ({"dice": [500]}, 2, "'dice' is no generator"),
        ({"drives": [99]}, 2, "give some from 100 on"),
        ({"drives": []}, 2, "give some from 100 on"),
        ({"drives": [500]}, 0, "0 cases a seed"),
    ],
)
def test_what_cannot_be_registered_is_told(seeds, cases, message):
    with pytest.raises(ValueError, match=message):
        registered(seeds, cases, commit="0" * 40)


def test_commands_say_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(register, "REGISTERED", tmp_path / "registered.json")
    assert main(["verify"]) == 2
    assert "nothing was registered" in capsys.readouterr().err
    assert main(["register"]) == 2
    assert "no seeds" in capsys.readouterr().err
    register.write(written())
    assert main(["verify"]) == 0
    assert "the tree is the one registered on 2026-01-01" in capsys.readouterr().out
    register.write(written() | {"tool": "0" * 64})
    assert main(["verify"]) == 1


def test_digest_of_a_generator_is_of_its_own_sources():
    assert now()["generators"] == {name: register.code(name) for name in ("drives", "played", "mujoco")}
    assert digest([*sorted((ROOT / "proof" / "mujoco").rglob("*.py")), *CASES]) == register.code("mujoco")
    assert register.code("drives") != register.code("played")
