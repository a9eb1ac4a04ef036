"""The ground study on a short capture: the time of first contact, and what the study writes."""

import json
from pathlib import Path

import numpy as np
import pytest

from snarelab.models.snare.history import SnareHistory
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import PAPER_POSITION, Target
from snarelab.studies import ground_capture

SHORT = 3.0
"""Just past first contact [s]."""


@pytest.fixture(scope="module")
def history() -> SnareHistory:
    return ground_capture.capture(SnareParameters(), Target("spring"), SHORT)


def test_first_contact_is_the_papers(history: SnareHistory) -> None:
    assert history.first_contact == pytest.approx(2.6, abs=0.1)
    # Until then the target hangs still: spring and weight balance.
    before = history.times < history.first_contact
    assert np.allclose(history.target_position[before], PAPER_POSITION, atol=1e-9)
    assert np.all(history.pin_force[before] == 0)
    # Then it is pushed towards the axis.
    assert history.pin_force[~before].sum(axis=0) @ [0, *PAPER_POSITION[1:]] < 0
    assert np.hypot(*history.target_position[-1, 1:]) < np.hypot(*PAPER_POSITION[1:])


def test_study_writes_page_and_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = ground_capture.capture
    monkeypatch.setattr(ground_capture, "capture", lambda parameters, target: whole(parameters, target, SHORT))
    usual = {"bending_damping": (1e-3,), "end_friction": (2e-3,)}
    monkeypatch.setattr(ground_capture, "SWEEPS", {"friction": (0.1, 0.3), **usual, "mass": (25.0, 50.0)})
    assert ground_capture.main() == 0
    said = capsys.readouterr().out
    assert "with friction 0.3 ..." in said
    result = json.loads((tmp_path / "build/studies/ground-capture/result.json").read_text())
    found = {q["name"]: q for q in result["quantities"]}
    assert {"first_contact", "final_radial_y", "final_radial_z", "peak_force"} <= set(found)
    assert (found["first_contact"]["paper"], found["first_contact"]["kind"]) == (2.6, "calibrated")
    assert {found[f"final_radial_{axis}"]["kind"] for axis in "yz"} == {"predicted"}
    assert found["peak_force"]["low"] <= found["peak_force"]["ours"] <= found["peak_force"]["high"]
    assert found["peak_force"]["low"] < found["peak_force"]["high"]  # A heavier target is hit harder.
    assert found["final_radial_y"]["ours"] == pytest.approx(PAPER_POSITION[1], rel=0.2)  # 3 s only
    assert [p.name for p in tmp_path.iterdir()] == ["build"]  # Exudyn would leave a folder of its own
    page = (tmp_path / "build/studies/ground-capture/report.html").read_text(encoding="utf-8")
    assert "in 0 of 3 captures" in page  # after 3 s
    assert "in 0 of 3 captures" in said
    assert "playback-data" in page
    assert page.count("data:image/svg+xml") == 4
