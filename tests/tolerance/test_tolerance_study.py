"""Study files and results folders: every mistake is one line that names it."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from snarelab import tolerance
from snarelab.errors import InputError
from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import Success, load_study
from snarelab.tolerance.summary import proxy_beside

GOOD = """
capture = "own_capture:CAPTURE"
[ranges]
radial_y = [-0.1, 0.1]
[fixed]
friction = 0.2
[success]
radial_error = 0.01
strength = 800.0
[box]
radial_y = [-0.02, 0.02]
cases = 10
"""


@pytest.fixture
def write(tmp_path: Path, monkeypatch):
    module = type(sys)("own_capture")
    axes = (Axis("radial_y", "m", "", 0.0, -0.5, 0.5), Axis("friction", "1", "", 0.1, 0.0, 1.0))
    vars(module)["CAPTURE"] = Capture("own", axes, lambda values: Outcome(True, 0.0, 1.0, 1.0, 1.0))
    monkeypatch.setitem(sys.modules, "own_capture", module)

    def save(text: str) -> Path:
        path = tmp_path / "study.toml"
        path.write_text(text)
        return path

    return save


def test_results_of_another_version_are_refused(write, tmp_path):
    study = load_study(write(GOOD))
    Results(tmp_path / "out", study)
    newer = replace(study, capture=replace(study.capture, version="b"))
    with pytest.raises(InputError, match=r"holds results of another study \(version was , is b\); name a new folder"):
        Results(tmp_path / "out", newer)


def test_one_value_for_all_cases_of_the_box(write):
    assert load_study(write(GOOD.replace("[-0.02, 0.02]", "0.02"))).box == {"radial_y": (0.02, 0.02)}


def test_a_good_study(write):
    study = load_study(write(GOOD))
    assert study.ranges == {"radial_y": (-0.1, 0.1)}
    assert study.values(study.scaled(np.array([[0.75]]))[0]) == pytest.approx({"radial_y": 0.05, "friction": 0.2})
    assert study.box_cases == 10


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[-0.1, 0.1]", "[0.1, -0.1]", r"\[ranges\] radial_y = \[0.1, -0.1\] is empty; low must be below high"),
        ("[-0.1, 0.1]", "[-0.9, 0.1]", "the model holds for -0.5 to 0.5 m"),
        ("radial_y = [-0.1, 0.1]", "", r"\[ranges\] is empty; name at least one of radial_y, friction"),
        ("radial_y = [-0.1, 0.1]", "radial_z = [-0.1, 0.1]", "unknown key 'radial_z'.*did you mean 'radial_y'"),
        ("radial_error = 0.01", "radial_error = 0", "radial_error = 0; no case can meet it"),
        ("strength = 800.0", "", r"\[success\] strength is missing"),
        ("[fixed]", "[fixed]\nradial_y = 0.0", r"radial_y stands in \[ranges\] and in \[fixed\]; keep one"),
        ("friction = 0.2", "friction = 2.0", "allowed is 0 to 1 1"),
        ("[-0.02, 0.02]", "[-0.2, 0.02]", r"\[box\] radial_y = \[-0.2, 0.02\] is not within \[ranges\]"),
        ("own_capture:CAPTURE", "no_such", "allowed are ground"),
        ("own_capture:CAPTURE", "nowhere:CAPTURE", "cannot be loaded"),
        ("capture =", "batch = 0\ncapture =", "batch = 0; allowed is a whole number from 1"),
        ("capture =", "sampling = 'grid'\ncapture =", "sampling = 'grid'; allowed are adaptive, sobol"),
        (
            "capture =",
            "cases = 2000\ncapture =",
            "cases = 2000; adaptive sampling takes at most 1000; give that",
        ),
        ("capture =", "envelope = 1\ncapture =", "envelope = 1; allowed is true or false or a table"),
        ("cases = 10", "ends = 1", r"\[box\] ends = 1; allowed is true or false"),
        ("radial_y = [-0.02, 0.02]", "radial_y = 0.2", r"\[box\] radial_y = \[0.2, 0.2\] is not within \[ranges\]"),
        ("radial_y = [-0.1, 0.1]", "radial_y = 0.1", r"\[ranges\] radial_y = 0.1; allowed is \[low, high\] in m"),
        ("capture =", "seed = [\ncapture =", "not a TOML file"),
    ],
)
def test_a_mistake_is_named(write, old, new, message):
    assert old in GOOD
    with pytest.raises(InputError, match=message) as caught:
        load_study(write(GOOD.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_results_of_another_study_are_refused(write, tmp_path):
    out = tmp_path / "out"
    study = load_study(write(GOOD))
    Results(out, study).add("space", 0, study.values(np.array([0.0])), Outcome(True, 0.0, 1.0, 1.0, 1.0))
    assert len(Results(out, load_study(write(GOOD)))) == 1
    with pytest.raises(InputError, match=r"another study \(seed was 1, is 2\)"):
        Results(out, load_study(write("seed = 2\n" + GOOD)))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "letter.txt").touch()
    with pytest.raises(InputError, match="holds no tolerance results"):
        Results(tmp_path / "other", study)


def test_a_full_disk_loses_nothing(write, tmp_path, monkeypatch):
    study = load_study(write(GOOD))
    results = Results(tmp_path / "out", study)
    good = Outcome(True, 0.0, 1.0, 1.0, 1.0)
    results.add("space", 0, study.values(np.array([0.0])), good)

    def full(self, path, **_):
        Path(path).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pandas.DataFrame.to_parquet", full)
        with pytest.raises(InputError, match="No space left on device; finished cases are kept; make room"):
            results.add("space", 1, study.values(np.array([0.01])), good)
    again = Results(tmp_path / "out", study)
    assert again.done("space", 0)
    assert not again.done("space", 1)
    assert not list((tmp_path / "out").rglob("*.part"))


def test_margin_says_how_far_from_failure():
    success = Success(radial_error=0.010, strength=800.0)
    assert success.margin(Outcome(True, 0.004, 1.0, 1.0, 100.0)) == pytest.approx(0.6)
    assert success.margin(Outcome(True, 0.004, 1.0, 1.0, 760.0)) == pytest.approx(0.05)
    assert success.margin(Outcome(True, 0.015, 1.0, 1.0, 100.0)) == pytest.approx(-0.5)
    assert success.margin(Outcome(False, 0.001, 1.0, 1.0, 100.0)) == -1
    assert success.margin(Outcome.failed("diverged")) == -1


def test_success_may_be_the_latch_and_the_proxy_stands_beside_it():
    """Four cases: both say yes, both no, the proxy too strict, the proxy too mild; and one without a result."""
    study = load_study(Path(str(tolerance.__file__)).with_name("latched_inspection.toml"))
    cases = [
        Outcome(True, 0.004, 7.0, 20.0, 30.0, latched=0.6, state="LATCHED"),
        Outcome(True, 0.012, 7.0, 20.0, 30.0, latched=-1.0, state="ABORTED"),
        Outcome(True, 0.012, 7.0, 20.0, 30.0, latched=0.4, state="LATCHED"),
        Outcome(True, 0.004, 7.0, 20.0, 30.0, latched=-1.0, state="STUCK"),
        Outcome.failed("diverged"),
    ]
    margins = [study.success.margin(case) for case in cases]
    assert margins == [0.6, -1.0, 0.4, -1.0, -1.0]
    assert [study.success.proxy(case) > 0 for case in cases] == [True, False, False, True, False]
    table = pd.DataFrame([{**vars(case), "margin": m} for case, m in zip(cases, margins, strict=True)])
    found = proxy_beside(study, table)
    assert found == {
        "cases": 4, "latched": 2, "disagree": 2, "latched_against": 1, "failed_against": 1,
        "ends": {"ABORTED": 1, "STUCK": 1},
    }  # fmt: skip
    assert study.identity()["success"]["latched"] is True
    assert "docking_friction" in study.ranges
