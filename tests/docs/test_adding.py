"""The guides "Add an effect", "... a nuisance", "... a participant": one new file each, as the page has it, no edit.

"Add a kind of recording" is one new folder.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.linalg

import snarelab

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(snarelab.__path__[0])
TURNTABLE = """<robot name="turntable"><link name="base"/>
<link name="table"><inertial><origin xyz="0.1 0 0"/><mass value="5"/>
<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.2"/></inertial></link>
<joint name="yaw" type="revolute"><parent link="base"/><child link="table"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="100" velocity="5"/></joint></robot>"""
INERTIA = 0.2 + 5 * 0.1**2


def blocks(page, language):
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.fixture
def copied(tmp_path):
    """A copy of the package, and how to run it: nothing but the file under test is added to it."""
    left_out = shutil.ignore_patterns(
        "__pycache__", ".*", "tests", "docs", "bench", "proof", "build", "*.csv", "*.egg-info"
    )
    shutil.copytree(PACKAGE, tmp_path / "copy" / "snarelab", ignore=left_out)

    def run(*commands, code=None):
        """What several commands print, one after the other in one process: engines load once; or what ``code`` does."""
        code = code or f"from snarelab.cli import main\nfor words in {commands!r}: assert main(words) == 0, words"
        environment = os.environ | {"PYTHONPATH": str(tmp_path / "copy")}
        ran = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    return tmp_path / "copy" / "snarelab", run


def record(path, sines, seed):
    """Position of the turntable, and its torque by formula: inertia, viscous friction, a spring of the third power."""
    t = np.arange(0, 16, 0.01)
    amplitude, w = np.array(sines).T[:, :, None]
    q, qd, qdd = (
        (amplitude * w**k * f(w * t)).sum(0) for k, f in ((0, np.sin), (1, np.cos), (2, lambda x: -np.sin(x)))
    )
    clean = INERTIA * qdd + 0.6 * qd + 0.8 * q * q * q
    tau = clean + 0.02 * np.random.default_rng(seed).normal(size=t.size)
    pd.DataFrame({"time": t, "q.yaw": q, "tau.yaw": tau}).to_csv(path, index=False)
    return pd.DataFrame({"time": t, "q": q, "qd": qd, "qdd": qdd, "tau": clean})


def test_an_effect_is_one_file(copied, tmp_path):
    package, run = copied
    source = next(b for b in blocks("adding-an-effect.md", "python") if "EFFECT = Effect(" in b)
    assert len(source.splitlines()) <= 60
    (package / "models" / "effects" / "harness_hardening.py").write_text(source, encoding="utf-8")
    (tmp_path / "table.urdf").write_text(TURNTABLE)
    (tmp_path / "table.toml").write_text('urdf = "table.urdf"\neffects = ["viscous_friction"]\n')
    (tmp_path / "known.toml").write_text('urdf = "table.urdf"\neffects = ["viscous_friction", "harness_hardening"]\n')
    record(tmp_path / "train.csv", [(0.9, 0.7), (0.5, 2.3), (0.1, 7.0)], 1)
    truth = record(tmp_path / "hold.csv", [(0.7, 1.1), (0.6, 1.9), (0.15, 5.0)], 2)

    compiler = shutil.which("cc") is not None
    outputs = ["--json", "found.json", "--report", "report.html", "--save-model", "new.toml"]
    said = run(
        ["identify", "known.toml", "train.csv", "--json", "fit.json"],
        ["diagnose", "table.toml", "train.csv", "--holdout", "hold.csv", *outputs],
        ["simulate", "new.toml", "--motion", "hold.csv", "--out", "torque.csv"],
        *([["export", "new.toml", "--fmi", "2", "--inverse", "--out", "new.fmu"]] if compiler else []),
    )
    fitted = {p["effect"]: p for p in json.loads((tmp_path / "fit.json").read_text())["parameters"]}
    assert fitted["harness_hardening"]["value"] == pytest.approx(0.8, rel=0.01)
    assert fitted["harness_hardening"]["unit"] == "N*m/rad^3"

    found = json.loads((tmp_path / "found.json").read_text())
    assert found["verdict"] == "missing_physics"
    assert [(e["name"], e["at"]) for e in found["effects"]] == [("harness_hardening", "yaw")]
    assert "harness hardening at yaw" in said
    assert "Harness hardening at yaw" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert {c["name"] for c in found["candidates"]} > {"harness_stiffness", "torque_ripple", "sensor_delay"}

    torque = pd.read_csv(tmp_path / "torque.csv")
    expected = np.interp(torque["time"], truth["time"], truth["tau"])
    size = np.sqrt(np.mean(expected**2))
    # Derivatives of a position without noise are exact in the band: 1 % is the parameters' own error.
    assert np.sqrt(np.mean((torque["tau.yaw"] - expected) ** 2)) < 0.01 * size

    if not compiler:
        pytest.skip("no C compiler: the effect in an FMU was not tried")
    assert fmu_torque(tmp_path / "new.fmu", truth) == pytest.approx(truth["tau"], abs=0.01 * size)


def shaken(path, sines, seed, phase):
    """The turntable with Coulomb friction of 0.06 N·m, and a pump that shakes it at 7 Hz with 0.3 N·m."""
    record(path, sines, seed)
    table = pd.read_csv(path)
    t, q = table["time"], table["q.yaw"]
    pump = 0.3 * np.sin(2 * np.pi * 7.0 * t + phase)
    table["tau.yaw"] += 0.06 * np.tanh(np.gradient(q, t) / 1e-3) - 0.8 * q**3 + pump
    table.to_csv(path, index=False)


def test_a_nuisance_is_one_file(copied, tmp_path):
    """As it is, the package takes the pump for noise that hides the friction; with the guide's file it does not."""
    package, run = copied
    (source,) = blocks("adding-a-nuisance.md", "python")
    (tmp_path / "table.urdf").write_text(TURNTABLE)
    (tmp_path / "table.toml").write_text('urdf = "table.urdf"\neffects = ["viscous_friction"]\n')
    shaken(tmp_path / "train.csv", [(0.9, 0.7), (0.5, 2.3), (0.1, 7.0)], 1, 0.3)
    shaken(tmp_path / "hold.csv", [(0.7, 1.1), (0.6, 1.9), (0.15, 5.0)], 2, 2.1)

    def told() -> tuple[str, dict[str, float]]:
        run(["diagnose", "table.toml", "train.csv", "--holdout", "hold.csv", "--json", "found.json"])
        found = json.loads((tmp_path / "found.json").read_text())
        return found["verdict"], {e["name"]: e["parameters"]["level"]["value"] for e in found["effects"]}

    assert told() == ("adequate", {})
    (package / "identification" / "arms" / "beside" / "pump.py").write_text(source, encoding="utf-8")
    verdict, levels = told()
    assert verdict == "missing_physics"
    assert levels == {"coulomb_friction": pytest.approx(0.06, abs=0.01)}


WHEEL = """<robot name="wheel"><link name="base"/>
<link name="rotor"><inertial><origin xyz="0 0 0"/><mass value="5"/>
<inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.06"/></inertial></link>
<joint name="wheel" type="continuous"><parent link="base"/><child link="rotor"/><axis xyz="0 0 1"/></joint></robot>"""


def run_down(path, start, seed):
    """Speed of a wheel of 0.06 kg·m² under Coulomb and viscous friction, by formula: it falls towards a speed below
    zero, which it would have if Coulomb friction did not end with its motion."""
    level, coefficient, t = 0.004, 1.1e-4, np.arange(0.0, 150.0, 1.5)
    speed = (start + level / coefficient) * np.exp(-coefficient * t / 0.06) - level / coefficient
    speed += 0.1 * np.random.default_rng(seed).normal(size=t.size)
    pd.DataFrame({"time": t, "qd.wheel": speed}).to_csv(path, index=False)


def test_a_kind_of_recording_is_one_folder(copied, tmp_path):
    package, run = copied
    source, kind, script = blocks("adding-a-kind-of-recording.md", "python")
    folder = package / "identification" / "run_down"
    folder.mkdir()
    for name, text in (("__init__.py", ""), ("source.py", source), ("kind.py", kind)):
        (folder / name).write_text(text, encoding="utf-8")
    (tmp_path / "wheel.urdf").write_text(WHEEL)
    (tmp_path / "wheel.toml").write_text(
        'urdf = "wheel.urdf"\neffects = ["viscous_friction"]\n'
        '[parameters]\n"viscous_friction.wheel.coefficient" = 1.2e-4\n'
    )
    for seed, (name, start) in enumerate((("fast", 300.0), ("slow", 150.0), ("again", 220.0))):
        run_down(tmp_path / f"{name}.csv", start, seed)
    said = run(code=f"{script}\nimport json\njson.dump(found.to_json(), open('found.json', 'w'))\n")
    assert "The model leaves out Coulomb friction at wheel." in said
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["verdict"] == "missing_physics"
    (effect,) = found["effects"]
    assert (effect["name"], effect["at"]) == ("coulomb_friction", "wheel")
    level = effect["parameters"]["level"]
    assert level["unit"] == "N*m"
    assert level["value"] == pytest.approx(0.004, abs=4 * level["std"])
    assert level["std"] < 0.02 * 0.004


def fmu_torque(path, motion):
    """Torque of an inverse FMU along a motion: set, read, step."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    description = read_model_description(str(path))
    assert description.coSimulation is not None
    number = {v.name: v.valueReference for v in description.modelVariables}
    assert "harness_hardening.yaw.hardening" in number
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(str(path), str(path.with_suffix(""))),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    inputs = [number[f"{x}.yaw"] for x in ("q", "qd", "qdd")]
    fmu.exitInitializationMode()
    found = []
    for row in motion.itertuples():
        fmu.setReal(inputs, [row.q, row.qd, row.qdd])
        found.append(fmu.getReal([number["tau.yaw"]])[0])
        fmu.doStep(row.time, 0.01)
    fmu.terminate()
    fmu.freeInstance()
    return np.array(found)


def exact(time):
    """The guide's mass on its spring with the lagging brake: x' = A x, solved by the matrix exponential."""
    m, k, d, gain, lag = 2.0, 10.0, 0.5, 3.0, 0.05
    a = np.array([[0, 1, 0], [-k / m, -d / m, 1 / m], [0, -gain / lag, -1 / lag]])
    return np.array([scipy.linalg.expm(a * t) @ [1.0, 0.0, 0.0] for t in time])


@pytest.mark.slow
def test_a_participant_is_one_file(copied, tmp_path):
    package, run = copied
    (source,) = blocks("adding-a-participant.md", "python")
    (system,) = blocks("adding-a-participant.md", "toml")
    (tmp_path / "motor.py").write_text(source, encoding="utf-8")
    (tmp_path / "brake.toml").write_text(system, encoding="utf-8")
    run(["cosim", "brake.toml", "--out", "run.csv"])
    ran = pd.read_csv(tmp_path / "run.csv")
    known = exact(ran["time"].iloc[::100])
    # The motor holds its speed over a millisecond, a fiftieth of its lag: half a step late at first order.
    assert np.abs(ran["mass.x [m]"].iloc[::100] - known[:, 0]).max() < 1e-3
    assert np.abs(ran["motor.force [N]"].iloc[::100] - known[:, 2]).max() < 0.02
    assert np.abs(known[:, 2]).max() > 1

    if shutil.which("cc") is None:
        pytest.skip("no C compiler: the participant as an FMU was not tried")
    (tmp_path / "motor.py").rename(package / "cosim" / "participants" / "motor.py")
    exported = system.replace('python = "motor:LaggingMotor"', 'fmu = "motor.fmu"')
    (tmp_path / "exported.toml").write_text(exported.replace("stop = 5.0", "stop = 0.5"), encoding="utf-8")
    run(
        ["export", "lagging_motor", "--fmi", "3", "--out", "motor.fmu"],
        ["cosim", "exported.toml", "--out", "again.csv", "--same-process"],
    )
    again = pd.read_csv(tmp_path / "again.csv")
    pd.testing.assert_frame_equal(again, ran.iloc[: len(again)], rtol=1e-12)
