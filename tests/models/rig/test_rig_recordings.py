"""Recordings of a suspension rig that Drake made: what identify and diagnose find in them."""

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr

from bench.drake_rig import rig_torque
from snarelab.identification.diagnose import diagnose
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.fit import channel_rms
from snarelab.identification.identify import identify
from snarelab.identification.simulate import simulate
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.models.rig.rig import built_in_rig
from snarelab.models.rigid_body import RigidBody
from snarelab.recordings import write_recording

RIG = built_in_rig()
PERIOD = 0.06
NOISE = 0.2  # N*m


def travel(seed, n=700):
    """Slow to-and-fro of every joint: q, qd, qdd (n, 7) each."""
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(n)
    found = np.zeros((3, n, 7))
    for j, size in enumerate((0.5, 0.15, 0.6, 0.7, 0.6, 0.2, 0.6)):
        for period in (17.0, 41.0):
            w, phase = 2 * np.pi / (period * rng.uniform(0.8, 1.2)), rng.uniform(0, 2 * np.pi)
            found[:, :, j] += size * np.stack(
                [np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase)]
            )
    return found[0], found[1], found[2]


def recorded(path, seed, friction, pull, cells=()):
    """Write what Drake gives for a travel, with noise; ``cells`` are slings whose tension is recorded.

    ``pull`` gives a sling's force, or what makes one of its hang point's velocities, sample after sample.
    """
    motion, rng = travel(seed), np.random.default_rng(seed + 100)

    def pulled(name: str, velocity: np.ndarray) -> Any:
        force = pull.get(name, 0.0)
        return force(velocity) if callable(force) else force

    tau = rig_torque(RIG, motion, friction, pulled, under_gravity=True)
    tau += NOISE * rng.normal(size=tau.shape)
    columns = {f"q.joint{j + 1}": motion[0][:, j] + 1e-8 * rng.normal(size=len(tau)) for j in range(7)}
    columns |= {f"tau.joint{j + 1}": tau[:, j] for j in range(7)}
    balance = {s.name: s.tension for s in RIG.slings}
    columns |= {f"tension.{s}": np.full(len(tau), balance[s] + pull.get(s, 0.0)) for s in cells}
    time = {"time": PERIOD * np.arange(len(tau))}
    write_recording(xr.Dataset({k: ("time", v) for k, v in columns.items()}, coords=time), path)


def dry(level, viscous):
    """Dry friction with a sharp corner that a smooth law has to follow."""
    return lambda speed: level * np.clip(speed / 1e-3, -1, 1) + viscous * speed


def model(folder, text):
    (folder / "rig.toml").write_text('system = "zero_g_rig"\n' + text, encoding="utf-8")
    return load_model(folder / "rig.toml")


def residual(given, path):
    """RMS of what the model leaves of each channel [N·m]."""
    experiments = load_experiments(given, [path], RigidBody(given.tree))
    assembly = TorqueModel(given.tree, given.effects, None, scales(experiments), given.values)
    return channel_rms(assembly, experiments, assembly.start)[0]


def test_a_measured_tension_is_a_known_load(tmp_path):
    recorded(tmp_path / "run.csv", 0, {}, {"sling6": 20.0, "sling9": -15.0}, cells=("sling6", "sling9"))
    given = model(tmp_path, "")
    assert np.all(residual(given, tmp_path / "run.csv") < 1.2 * NOISE)
    table = (tmp_path / "run.csv").read_text().replace("tension.", "other.")
    (tmp_path / "without.csv").write_text(table)
    assert residual(given, tmp_path / "without.csv")[1] > 20 * NOISE


def test_a_missing_tension_is_a_gap(tmp_path):
    recorded(tmp_path / "run.csv", 0, {}, {"sling6": 20.0}, cells=("sling6",))
    lines = (tmp_path / "run.csv").read_text().splitlines()
    column = lines[0].split(",").index("tension.sling6")
    for k in range(300, 320):
        cells = lines[k].split(",")
        lines[k] = ",".join([*cells[:column], "", *cells[column + 1 :]])
    (tmp_path / "holes.csv").write_text("\n".join(lines) + "\n")
    given = model(tmp_path, "")
    found = load_experiments(given, [tmp_path / "holes.csv"], RigidBody(given.tree))[0]
    assert len(found.motion.segments) == 2
    assert np.isfinite(found.tension["sling6"]).all()
    assert np.all(residual(given, tmp_path / "holes.csv") < 1.2 * NOISE)


def test_identify_gives_friction_curves_and_flags_parameters_that_nothing_carries(tmp_path):
    """Joint 5 rubs with a sharp corner that no tanh has; joint 4 does not rub at all."""
    recorded(tmp_path / "run.csv", 1, {"joint5": dry(30.0, 80.0)}, {})
    effects = '[{ name = "slide_friction", at = "joint4" }, { name = "slide_friction", at = "joint5" }]'
    found = identify(model(tmp_path, f"effects = {effects}\n"), [tmp_path / "run.csv"])
    answer = json.loads(json.dumps(found.to_json()))
    assert [(c["at"], c["kind"], c["unit"]) for c in answer["curves"]] == [(f"joint{j}", "slide", "N") for j in (4, 5)]
    for curve, law in zip(answer["curves"], (dry(0.0, 0.0), dry(30.0, 80.0)), strict=True):
        speed, value, std = (np.array(curve[key]) for key in ("speed", "value", "std"))
        moving = np.abs(speed) > 0.05 * np.abs(speed).max()
        wanted = np.array([law(v) for v in speed])
        np.testing.assert_allclose(value[moving], wanted[moving], atol=0.3)
        assert np.all(std[moving] < 0.3)
    carried = {at: [p["identifiable"] for p in answer["parameters"] if p["at"] == at] for at in ("joint4", "joint5")}
    assert not any(carried["joint4"])
    assert any(carried["joint5"])
    assert all(p["std"] <= abs(p["value"]) for p in answer["parameters"] if p["identifiable"])


@pytest.mark.slow
def test_diagnose_names_a_slide_and_a_sling(tmp_path):
    concealed = {"joint4": dry(30.0, 0.0)}, {"sling6": 18.0}
    for k in range(2):
        recorded(tmp_path / f"run{k}.csv", k, *concealed)
    given = model(tmp_path, 'effects = ["viscous_friction"]\n')
    answer = diagnose(given, [tmp_path / "run0.csv"], tmp_path / "run1.csv")
    found = {(f.name, f.at): f for f in answer.diagnosis.effects}
    assert set(found) == {("slide_friction", "joint4"), ("sling_tension_error", "sling6")}
    share = found["sling_tension_error", "sling6"].parameters["share"]
    tension = next(s.tension for s in RIG.slings if s.name == "sling6")
    assert share.value == pytest.approx(18.0 / tension, rel=0.02)
    # What was found is saved, and simulates what was recorded.
    save_model(answer.model, tmp_path / "found.toml", "note")
    again = simulate(load_model(tmp_path / "found.toml"), tmp_path / "run1.csv")
    assert float(np.std(again["tau.joint2"])) > 0
    assert np.all(residual(load_model(tmp_path / "found.toml"), tmp_path / "run1.csv") < 5 * NOISE)


def carriage(tension, lag, length=10.0, damping=0.8):
    """Pull of a sling whose carriage follows as a servo of second order, and not of first as the tool's law."""
    bandwidth = 2 * damping / lag
    lead, speed = np.zeros(2), np.zeros(2)

    def pull(velocity):
        nonlocal lead, speed
        steps = 50
        for _ in range(steps):
            speed = speed + PERIOD / steps * (bandwidth**2 * lead - 2 * damping * bandwidth * speed)
            lead = lead + PERIOD / steps * (velocity[:2] - speed)
        return np.append(-tension / length * lead, 0.0)

    return pull


@pytest.mark.slow
def test_what_a_law_of_sway_has_wrong_is_given_no_name(tmp_path):
    for k in range(2):
        recorded(tmp_path / f"run{k}.csv", k, {}, {"sling9": carriage(500.0, 1.0)})
    answer = diagnose(model(tmp_path, ""), [tmp_path / "run0.csv"], tmp_path / "run1.csv")
    assert [(f.name, f.at) for f in answer.diagnosis.effects] == [("suspension_sway", "sling9")]
