"""`make study-tolerance`: both studies run by it on captures of known outcome, what it leaves, and that it goes on."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from snarelab.studies import tolerance
from snarelab.studies.outcome import FOLDER
from snarelab.tolerance.study import load_study

RADIAL, ANGLE, SHARE = 0.03, 0.05, 1.5
"""A capture succeeds within these [m, rad]; the inspection case is made to take more by ``SHARE``."""
CAPTURES = f"""
import numpy as np
from snarelab.tolerance.capture import Axis, Capture, Outcome

UNITS = {{"radial_y": "m", "radial_z": "m", "pitch": "rad", "yaw": "rad"}}

def run(values, share):
    off = np.hypot(values["radial_y"], values["radial_z"]) / {RADIAL}
    askew = np.hypot(values["pitch"], values["yaw"]) / {ANGLE}
    return Outcome(True, 0.01 * max(off, askew) / share, 2.6, 5.0, 100.0)

def capture(name, share):
    axes = tuple(Axis(n, unit, n, 0.0, -1.0, 1.0) for n, unit in UNITS.items())
    return Capture(name, axes, lambda values: run(values, share))

ground, inspection = capture("ground", 1.0), capture("inspection", {SHARE})
"""
STUDY = """
name = "{name}"
capture = "known_captures:{name}"
sampling = "adaptive"
batch = 16
cases = 32
width = 0.2
[ranges]
radial_y = [-0.1, 0.1]
radial_z = [-0.1, 0.1]
pitch = [-0.15, 0.15]
yaw = [-0.15, 0.15]
[success]
radial_error = 0.010
strength = 8000.0
[box]
radial_y = [-0.02, 0.02]
radial_z = [-0.02, 0.02]
pitch = [-0.03, 0.03]
yaw = [-0.03, 0.03]
cases = 20
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    (tmp_path / "known_captures.py").write_text(CAPTURES)
    monkeypatch.setattr(tolerance, "STUDIES", {"ground": "ground_", "inspection": ""})
    for name in tolerance.STUDIES:
        (tmp_path / f"{name}.toml").write_text(STUDY.format(name=name))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr(tolerance, "_FILES", tmp_path)
    return tmp_path / FOLDER / "tolerance"


@pytest.mark.slow
def test_both_studies_leave_the_documented_numbers_and_go_on(here, capsys):
    assert tolerance.main() == 0
    first = json.loads((here / "result.json").read_text())
    assert (first["study"], first["command"]) == ("tolerance", "make study-tolerance")
    found = {q["name"]: q for q in first["quantities"]}
    for prefix, share in (("", SHARE), ("ground_", 1.0)):
        for name, unit, limit in (("envelope_radial", "m", RADIAL), ("envelope_angle", "rad", ANGLE)):
            q = found[prefix + name]
            assert q["unit"] == unit
            assert q["low"] <= share * limit <= q["high"]
            assert q["high"] - q["low"] < 0.1 * limit
        box = found[f"{prefix}probability_at_paper"]
        assert box["ours"] == 1.0  # 28 mm and 42 mrad in the corners of the box
        assert box["low"] == pytest.approx(0.025 ** (1 / 20))  # Clopper and Pearson's, of 20 out of 20
        assert found[f"{prefix}seconds_per_case"]["ours"] > 0
    page = (here / "report.html").read_text(encoding="utf-8")
    folders = sorted(p.name for p in here.iterdir() if p.is_dir())
    assert all(
        f'href="{folder}/report.html"' in page and (here / folder / "report.html").is_file() for folder in folders
    )
    assert len(folders) == 2
    assert (
        page.count("In none of the 12 directions tried, everything else at nominal, does success end before the box")
        == 2
    )

    capsys.readouterr()
    assert tolerance.main() == 0
    again = {q["name"]: q for q in json.loads((here / "result.json").read_text())["quantities"]}
    assert again == {name: q for name, q in found.items() if not name.endswith("seconds_per_case")}
    assert f"{found['ground_cases']['ours']:.0f} cases are there" in capsys.readouterr().out


def test_kept_cases_of_the_same_physics_are_gone_on_with(here, tmp_path):
    """And those of other physics are not: the folder's name has the version."""
    study = load_study(tmp_path / "ground.toml")
    values = dict.fromkeys(study.ranges, 0.01)
    kept = tmp_path / "kept"
    first = tolerance.opened(kept, study, tmp_path / "none")
    first.add("box", 0, values, study.capture.run(values))
    again = tolerance.opened(here, study, kept)
    assert (len(again), again.done("box", 0)) == (1, True)
    again.add("box", 1, values, study.capture.run(values))
    assert len(tolerance.opened(here, study, kept)) == 2
    assert len(tolerance.opened(kept, study, tmp_path / "none")) == 1
    other = replace(study, capture=replace(study.capture, version="other"))
    assert len(tolerance.opened(here, other, kept)) == 0


def test_kept_cases_are_of_the_physics_of_today():
    """Cases of other physics are of no use: delete them, and run `make study-tolerance` anew."""
    studies = [load_study(tolerance._FILES / f"{name}.toml") for name in tolerance.STUDIES]
    today = {f"{s.name}-{s.capture.version}" for s in studies}
    kept = Path(__file__).parents[2] / tolerance.KEPT
    assert {p.name for p in kept.iterdir()} <= today
