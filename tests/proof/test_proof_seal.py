"""Answers are sealed before the tool runs, and what was recorded stays as it was sealed."""

import hashlib
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from proof import cases, oracle, rivals, run
from proof.score import score
from proof.seal import BrokenSeal

SEED = 90500


@pytest.mark.slow
def test_answers_are_sealed_before_the_tool_runs_and_nowhere_to_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "TRAIN", 8.0)
    monkeypatch.setattr(cases, "HOLDOUT", 5.0)
    monkeypatch.setattr(cases, "THIRD", 5.0)
    seen, told, scored = [], [], []
    over = (1.1, 1.2)
    monkeypatch.setattr(oracle, "run", lambda x: {"over_floor": [{"tau.joint1": x.number + o} for o in over]})
    monkeypatch.setattr(run, "score", lambda *given: scored.append(given[2]) or score(*given))

    def tool(folder: Path):
        seal = json.loads((tmp_path / "sealed.json").read_text())
        assert any(seal["answers"] in words for words in told)
        assert {p.name for p in folder.iterdir()} == {"arm.toml", "arm.urdf", "train.csv", "hold.csv", "third.csv"}
        assert {p.name for p in tmp_path.iterdir()} <= {"sealed.json", "recordings", "diagnoses.jsonl"}
        seen.append(folder)
        return said(after=1.0) | {"seconds": 1.0}

    def said(after):
        third = {f"tau.joint{k}": [2.0, after] for k in range(1, 4)}
        return {"verdict": "adequate", "effects": [], "third": third, "band": {"value": 20.0}, "candidates": []}

    monkeypatch.setattr(rivals, "run", lambda folder: dict.fromkeys(rivals.NAMES, said(2.0)) | {"seconds": 1.0})
    monkeypatch.setattr(cases, "N_JOINTS", (3,))

    def prove():
        with ThreadPoolExecutor(1) as pool:
            return run.prove(2, SEED, pool, folder=tmp_path, tell=told.append, run=tool)

    result = prove()
    own, theirs = ([{"tau.joint1": k + o} for k in (0, 1)] for o in over)
    assert scored == [own, *[theirs] * len(rivals.NAMES)]  # each method is held to the oracles in its own band
    answers = (tmp_path / "answers.json").read_bytes()
    assert hashlib.sha256(answers).hexdigest() == result["answers_sha256"]
    assert [a["case"] for a in json.loads(answers)] == [0, 1]
    assert "answers&#x27; SHA-256" in (tmp_path / "report.html").read_text()
    written = json.loads((tmp_path / "result.json").read_text())
    names = {q["name"] for q in written["quantities"]}
    wanted = {"false_alarms", "name_at_0.5x", "name_at_1x", "name_at_2x", "place", "unknown_recall", "pairs"}
    wanted |= {"closure_median", "calibration_error"}
    assert names >= wanted | {f"{rival}.{name}" for rival in rivals.NAMES for name in wanted}
    prove()
    assert len(seen) == 2  # nothing is done twice
    path = tmp_path / "recordings" / "0001" / "hold.csv"
    path.write_text(path.read_text().replace("1", "2", 1))
    with pytest.raises(BrokenSeal, match="not those sealed"):
        prove()
