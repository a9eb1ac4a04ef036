"""The benchmark for any tool: what is handed out, what is kept apart, answers that break the rules, and the figures."""

import json
from pathlib import Path

import numpy as np
import pytest

from proof.benchmark.answers import read_answers
from proof.benchmark.case_set import CaseSet, columns, export, write
from proof.benchmark.command import main
from proof.benchmark.methods import answer
from proof.benchmark.score import score
from proof.rival_columns import CUTOFF


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> CaseSet:
    """Three cases, drawn once."""
    return export(tmp_path_factory.mktemp("set") / "cases", 96, 3, lambda _: None)


def given(cases: CaseSet, folder: Path, **of: object) -> Path:
    """An answer file: every case adequate, but for those that are given."""
    folder.mkdir(parents=True, exist_ok=True)
    said = {name: {"verdict": "adequate", "effects": []} for name in cases.names()}
    path = folder / "answers.json"
    path.write_text(json.dumps({"tool": "by hand", "cases": said | of}))
    return path


def truthful(cases: CaseSet) -> dict[str, object]:
    """What somebody would say who knows."""
    said = {}
    for name, truth in cases.truths().items():
        effects = [{"name": e["name"], "at": e["at"], "probability": 1.0} for e in truth["effects"] if e["name"]]
        lawless = any(not e["name"] for e in truth["effects"])
        verdict = "unknown_effect" if lawless else "missing_physics" if effects else "adequate"
        said[name] = {"verdict": verdict, "effects": effects}
    return said


def test_nothing_that_is_handed_out_tells_the_answer(cases):
    handed = [p for p in cases.folder.rglob("*") if p.is_file()]
    assert {p.name for p in handed if p.parent.parent.name == "cases"} == {
        *("arm.urdf", "arm.toml", "case.json", "fit.csv", "confirm.csv", "predict.csv")
    }
    for path in handed:
        text = path.read_text(encoding="utf-8")
        assert "disturbance_rms" not in text
        assert '"seed"' not in text
    for name in cases.names():
        last = columns(cases.case(name) / "predict.csv")
        assert not any(k.startswith("tau.") for k in last)
        fit = columns(cases.case(name) / "fit.csv")
        assert {k for k in fit if not k.startswith("tau.")} == set(last)


def test_truth_that_was_changed_is_no_truth(cases, tmp_path):
    other = CaseSet(tmp_path / "cases")
    other.folder.mkdir()
    other.truth_folder.mkdir()
    (other.folder / "set.json").write_text((cases.folder / "set.json").read_text())
    text = (cases.truth_folder / "truths.json").read_text()
    (other.truth_folder / "truths.json").write_text(text)
    assert other.truths() == json.loads(text)
    (other.truth_folder / "truths.json").write_text(text.replace('"clean"', '"single"', 1) + " ")
    with pytest.raises(ValueError, match=r"is not what .* was sealed with"):
        other.truths()


def test_who_knows_the_truth_is_right_everywhere(cases, tmp_path):
    tool, figures = score(cases, given(cases, tmp_path, **truthful(cases)))
    found = {f.name: f for f in figures}
    assert tool == "by hand"
    assert found["wrong names a case"].value == 0.0
    assert found["no answer: failed or out of time"].value == 0.0
    named = [e for t in cases.truths().values() for e in t["effects"] if e["name"]]
    told = [f for f in figures if f.name.startswith("single") and f.name.endswith("its name at its place") and f.count]
    assert all(f.value == 1.0 for f in told)
    assert len(named) + sum(t["group"] == "nameless" for t in cases.truths().values()) > 0


def test_case_without_an_answer_counts_as_one(cases, tmp_path):
    path = tmp_path / "answers.json"
    path.write_text(json.dumps({"tool": "lazy", "cases": {}}))
    found = {f.name: f.value for f in score(cases, path)[1]}
    assert found["no answer: failed or out of time"] == 1.0


def test_predicted_torque_is_held_against_what_was_measured(cases, tmp_path):
    """The measured torque itself leaves nothing; twice the baseline's error, in band, is twice it."""
    path = given(cases, tmp_path, **truthful(cases))
    (tmp_path / "torque").mkdir()
    concealed = {n: t for n, t in cases.truths().items() if t["effects"]}
    assert concealed
    for name in concealed:
        write(tmp_path / "torque" / f"{name}.csv", cases.torque(name))
    perfect = {f.name: f.value for f in score(cases, path)[1]}
    assert perfect["torque error over the baseline's, worst"] == pytest.approx(0.0, abs=1e-6)
    for name, truth in concealed.items():
        measured = cases.torque(name)
        time = columns(cases.case(name) / "predict.csv")["time"]
        wave = np.sqrt(2.0) * np.sin(2 * np.pi * 1.0 * time)  # 12 whole seconds, far below the band's edge
        off = {k: x + 2.0 * truth["baseline_rms"][k] * wave for k, x in measured.items()}
        write(tmp_path / "torque" / f"{name}.csv", off)
    twice = {f.name: f.value for f in score(cases, path)[1]}
    assert twice["torque error over the baseline's, median"] == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"verdict": "fine", "effects": []}, "verdict 'fine' is none of adequate"),
        ({"verdict": "adequate", "effects": {}}, "give a list"),
        ({"verdict": "missing_physics", "effects": [{"name": "gremlins", "at": "joint1"}]}, "not in vocabulary.json"),
        ({"verdict": "missing_physics", "effects": [{"name": "stribeck_friction"}]}, "has no name and place"),
        (
            {"verdict": "missing_physics", "effects": [{"name": "stribeck_friction", "at": "elbow", "probability": 1}]},
            "'elbow' is no place|\"elbow\" is no place",
        ),
        (
            {
                "verdict": "missing_physics",
                "effects": [{"name": "stribeck_friction", "at": "joint1", "probability": 90}],
            },
            "probability 90 is not between 0 and 1",
        ),
        ({"verdict": "adequate", "effects": [], "seconds": "long"}, "seconds 'long' is no time"),
    ],
)
def test_answer_that_breaks_the_rules_is_told_in_one_line(cases, tmp_path, said, message):
    path = given(cases, tmp_path, **{cases.names()[0]: said})
    with pytest.raises(ValueError, match=message) as caught:
        read_answers(path, cases)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_case_that_is_not_in_the_set_is_told(cases, tmp_path, capsys):
    path = given(cases, tmp_path, **{"9999": {"verdict": "adequate", "effects": []}})
    assert main(["score", str(cases.folder), str(path)]) == 2
    assert 'case "9999" is not in the set' in capsys.readouterr().err


def test_folder_without_a_set_is_told(tmp_path, capsys):
    assert main(["score", str(tmp_path), str(tmp_path / "answers.json")]) == 2
    assert "holds no cases; write some: python -m proof export" in capsys.readouterr().err


@pytest.mark.slow
def test_rival_answers_the_set_by_its_files_alone(cases, tmp_path):
    """The worked example: from a copy without the truth, to figures; asked again, nothing is answered twice."""
    out = tmp_path / "answers.json"
    answer(cases, "joint_bic", out, lambda _: None)
    said = json.loads(out.read_text())["cases"]
    assert list(said) == cases.names()
    for name in cases.names():
        predicted = columns(tmp_path / "torque" / f"{name}.csv")
        assert len(next(iter(predicted.values()))) == len(columns(cases.case(name) / "predict.csv")["time"])
    figures = {f.name: f for f in score(cases, out)[1]}
    # It may be wrong in its names; its torque is nearer than that of the baseline which it starts from.
    median = figures["torque error over the baseline's, median"].value
    assert median is not None
    assert median < 1.0
    answer(cases, "joint_bic", out, lambda _: None, run=lambda *_: pytest.fail("asked again"))
    with pytest.raises(ValueError, match="holds the answers of joint_bic"):
        answer(cases, "snarelab", out, lambda _: None)


def test_rules_tell_the_band_that_is_scored():
    text = (Path(__file__).parents[2] / "proof" / "benchmark" / "RULES.md").read_text(encoding="utf-8")
    assert f"below {CUTOFF:g} Hz" in text
