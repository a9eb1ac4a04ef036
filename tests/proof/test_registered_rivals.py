"""The rivals on registered cases: asked once about what the tool has answered, judged on the same truths."""

import json

import pytest

from proof import registered_rivals as asked
from proof.registered_rivals import ask, compared, of_case, printed

REGISTERED = {"tool": "t", "seeds": {"drives": [500]}, "cases": 3, "bars": {"clean: a false name": [0.02, "at most"]}}
TRUTH = {"group": "clean", "disturbance": {"kind": "white"}, "effects": [], "background": [], "known": {}}
NAMED = [{"name": "sensor_bias", "at": "tau.joint1", "probability": 0.9, "rivals": []}]


def own(path, *cases):
    lines = [
        {"case": k, "version": "t", "verdict": "adequate", "effects": [], "seconds": 1.0, "truth": TRUTH} for k in cases
    ]
    path.write_text("".join(json.dumps(x) + "\n" for x in lines))


@pytest.fixture
def drawn(monkeypatch):
    """A generator that draws folders with a truth alone, and rivals that name what nobody concealed, or break down."""
    numbers = []

    def make(folder, seed, count, tell=print, first=0):
        case = folder / f"{first:04}"
        case.mkdir(parents=True, exist_ok=True)
        (case / "truth.json").write_text(json.dumps(TRUTH))
        numbers.append(first)
        return [case]

    def task(case, names=()):
        if case.name == "0001":
            raise ValueError("a filter needs more samples")

    monkeypatch.setattr(asked, "GENERATORS", {"drives": make})
    monkeypatch.setattr(asked.rivals, "Task", task)
    monkeypatch.setattr(asked, "METHODS", {"bold": lambda *_: {"verdict": "missing_physics", "effects": NAMED}})
    return numbers


def test_rivals_are_asked_once_about_what_the_tool_has_answered(drawn, tmp_path):
    answers = tmp_path / "answers"
    answers.mkdir()
    own(answers / "drives-500.jsonl", "0000", "0001")
    for _ in range(2):
        ask(REGISTERED, 1.0, lambda _: None, tmp_path / "cases", answers, clock=lambda: 0.0)
    assert drawn == [0, 1]
    figures = compared(REGISTERED, answers)["drives"]
    values = {method: next(f for f in own if f.name == "clean: a false name").value for method, own in figures.items()}
    assert values == {"snarelab": 0.0, "bold": 0.5}  # it broke down on the other
    text = printed(REGISTERED, compared(REGISTERED, answers)).splitlines()
    assert text[0].split() == ["drives", "n", "snarelab", "bold"]
    assert text[1].split()[-5:] == ["2", "0.0", "%", "50.0", "%"]
    assert printed(REGISTERED, {"drives": {}}).startswith("no case")


def test_time_ends_between_two_cases(drawn, tmp_path):
    own(tmp_path / "drives-500.jsonl", "0000", "0001")
    time = iter((0.0, 1.0, 3600.0))
    ask(REGISTERED, 1.0, lambda _: None, tmp_path / "cases", tmp_path, clock=lambda: next(time))
    assert drawn == [0]


def test_another_case_is_no_comparison(drawn, tmp_path):
    own(tmp_path / "drives-500.jsonl", "0000")
    ask(REGISTERED, 1.0, lambda _: None, tmp_path / "cases", tmp_path, clock=lambda: 0.0)
    text = (tmp_path / "drives-500.jsonl").read_text()
    (tmp_path / "drives-500.jsonl").write_text(text.replace("white", "wandering"))
    with pytest.raises(ValueError, match="drives 500 0000: the rivals were asked about another case"):
        compared(REGISTERED, tmp_path)


def test_oracle_is_the_baseline_on_the_twin(monkeypatch, tmp_path):
    import numpy as np

    class Task:
        def __init__(self, case, names=()):
            self.residual_hold = np.full((4, 1), 1.0 if case.name == "twin" else 5.0)

    said = {"verdict": "missing_physics", "effects": NAMED, "third": {"tau.joint1": [5.0, 2.0]}}
    monkeypatch.setattr(asked.rivals, "Task", Task)
    monkeypatch.setattr(asked, "METHODS", {"bold": lambda *_: said})
    (tmp_path / "truth.json").write_text(json.dumps(TRUTH))
    assert "third" not in of_case(tmp_path)["methods"]["bold"]
    (tmp_path / "twin").mkdir()
    assert of_case(tmp_path)["methods"]["bold"]["third"] == {"tau.joint1": [5.0, 2.0, 1.0]}
