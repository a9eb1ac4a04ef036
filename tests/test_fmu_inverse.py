"""The loop closed: a model found by diagnosis, exported, reproduces along a motion what `simulate` and the fit say."""

import json

import numpy as np
import pandas as pd
import pytest

from bench.fmu_models import Slave, everywhere, write_model
from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.fmu.export import export, model_equations
from snarelab.fmu.inverse import inverse_equations
from snarelab.identification.simulate import simulate
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody
from snarelab.recordings import JointKind, read_recording
from snarelab.recordings.condition import condition


def motion(n, seconds, seed, rate=200.0):
    """Time (n,) and sums of sines with derivatives, each (n_samples, n)."""
    t = np.arange(round(seconds * rate)) / rate
    q, qd, qdd = np.zeros((3, len(t), n))
    for k, frequency in enumerate((0.31, 0.83, 1.7)):
        for j in range(n):
            w = 2 * np.pi * frequency * (1 + 0.17 * j + 0.05 * seed)
            a = 0.6 / (1 + 2 * k)
            q[:, j] += a * np.sin(w * t + k)
            qd[:, j] += a * w * np.cos(w * t + k)
            qdd[:, j] -= a * w**2 * np.sin(w * t + k)
    return t, q, qd, qdd


def follow(path, folder, dataset, joints):
    """Torque (n_samples, J) that an FMU gives along a motion: set, read, step."""
    time = dataset["time"].values
    found = np.empty((len(time), len(joints)))
    columns = {f"{x}.{j}": dataset[f"{x}.{j}"].values for x in ("q", "qd", "qdd") for j in joints}
    s = Slave(path, folder, {name: values[0] for name, values in columns.items()}, start_time=time[0])
    for k in range(len(time)):
        s.set({name: values[k] for name, values in columns.items()})
        found[k] = s.get([f"tau.{j}" for j in joints])
        if k + 1 < len(time):
            s.step(time[k + 1] - time[k])
    s.close()
    return found


@pytest.mark.parametrize("version", [2, 3])
def test_follows_as_simulate_does_hidden_states_and_sensors_included(tmp_path, version):
    values = everywhere("coulomb_friction", "level", [3.0, 2.0]) | {
        "speed_scale.joint1": 4.0,
        "speed_scale.joint2": 5.0,
    }
    values |= {"presliding_hysteresis.joint1.level": 1.5, "presliding_hysteresis.joint1.travel": 0.02}
    values |= {"joint_elasticity.joint2.stiffness": 900.0, "joint_elasticity.joint2.damping": 4.0}
    values |= {"sensor_delay.tau.joint1.delay": 0.012, "sensor_gain.tau.joint2.error": 0.05}
    values |= {"load_dependent_friction.joint2.coefficient": 0.1, "com_offset.link2.x": 0.02, "com_offset.link2.y": 0.0}
    values |= {"com_offset.link2.z": -0.01}
    effects = """["coulomb_friction", { name = "presliding_hysteresis", at = "joint1" },
        { name = "joint_elasticity", at = "joint2" }, { name = "load_dependent_friction", at = "joint2" },
        { name = "com_offset", at = "link2" }, { name = "sensor_delay", at = "tau.joint1" },
        { name = "sensor_gain", at = "tau.joint2" }]"""
    path = write_model(tmp_path, "arm", 2, effects, values)
    t, q, _, _ = motion(2, 4.0, 0)
    columns = {"time": t, "q.joint1": q[:, 0], "q.joint2": q[:, 1], "tau.joint1": 1 + 0 * t, "tau.joint2": 1 + 0 * t}
    pd.DataFrame(columns).to_csv(tmp_path / "motion.csv", index=False)
    wanted = simulate(load_model(path), tmp_path / "motion.csv")
    export(str(path), version, tmp_path / "x.fmu", inverse=True)
    found = follow(tmp_path / "x.fmu", tmp_path / "x", wanted, ["joint1", "joint2"])
    for k in (0, 1):
        tau = wanted[f"tau.joint{k + 1}"].values
        np.testing.assert_allclose(found[:, k], tau, rtol=0, atol=1e-9 * np.abs(tau).max())


def test_diagnose_export_and_simulate_reproduce_the_improved_fit(tmp_path):
    """Stribeck friction that the model leaves out is found; its FMU has the holdout residual that diagnose reports."""
    path = write_model(tmp_path, "arm", 1, '["viscous_friction", "coulomb_friction"]', {}, seed=2)
    body, rng = RigidBody(load_model(path).tree), np.random.default_rng(1)
    for name, seed in (("train", 0), ("hold", 1)):
        t, q, qd, qdd = motion(1, 20.0, seed)
        friction = 6.0 * qd + np.tanh(qd / 1e-3) * (4.0 + 6.0 * np.exp(-((qd / 0.35) ** 2)))
        tau = body.torque(q, qd, qdd) + friction + 0.1 * rng.normal(size=q.shape)
        pd.DataFrame({"time": t, "q.joint1": q[:, 0], "tau.joint1": tau[:, 0]}).to_csv(
            tmp_path / f"{name}.csv", index=False
        )
    given = [
        "diagnose",
        path,
        tmp_path / "train.csv",
        "--holdout",
        tmp_path / "hold.csv",
        "--json",
        tmp_path / "d.json",
    ]
    assert main([str(x) for x in [*given, "--save-model", tmp_path / "new.toml"]]) == 0
    told = json.loads((tmp_path / "d.json").read_text())
    assert told["verdict"] == "missing_physics"
    fit = told["fit"]["tau.joint1"]["holdout"]
    assert fit["rms_after"] < 0.7 * fit["rms_before"]
    model = load_model(tmp_path / "new.toml")
    export(str(tmp_path / "new.toml"), 3, tmp_path / "x.fmu", inverse=True)
    kinds: dict[str, JointKind] = {"joint1": "revolute"}
    recorded = condition(read_recording(tmp_path / "hold.csv", {}, kinds), ["joint1"], told["band"]["value"])
    along = simulate(model, tmp_path / "hold.csv")
    found = follow(tmp_path / "x.fmu", tmp_path / "x", along, ["joint1"])
    residual = recorded.to_band(recorded.tau[:, 0] - found[:, 0])
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(fit["rms_after"], rel=1e-6)
    # And the arm itself carries the new physics, under its own name.
    export(str(tmp_path / "new.toml"), 3, tmp_path / "arm.fmu")
    s = Slave(tmp_path / "arm.fmu", tmp_path / "arm")
    assert {f"{p.key}.{x.name}" for p in model.effects for x in p.effect.parameters} <= set(s.references)
    s.close()


def test_a_late_position_cannot_be_followed(tmp_path):
    path = write_model(
        tmp_path, "arm", 1, '[{ name = "sensor_delay", at = "q.joint1" }]', {"sensor_delay.q.joint1.delay": 0.01}
    )
    with pytest.raises(InputError, match=r"sensor_delay.q.joint1 .*ahead"):
        inverse_equations(load_model(path))


def test_a_rig_in_balance_feels_no_gravity(tmp_path):
    """The built-in rig's slings carry its weight: along a motion as `simulate` has it, and at rest nothing moves."""
    joints = [f"joint{k}" for k in range(1, 8)]
    values = everywhere("viscous_friction", "coefficient", np.arange(1.0, 8.0))
    lines = ['name = "rig"', 'system = "zero_g_rig"', 'effects = ["viscous_friction"]', "[parameters]"]
    (tmp_path / "rig.toml").write_text(
        "\n".join([*lines, *(f'"{k}" = {float(v)!r}' for k, v in values.items())]) + "\n"
    )
    t, q, _, _ = motion(7, 2.0, 0)
    columns = (
        {"time": t} | {f"q.{j}": 0.2 * q[:, k] for k, j in enumerate(joints)} | {f"tau.{j}": 1 + 0 * t for j in joints}
    )
    pd.DataFrame(columns).to_csv(tmp_path / "motion.csv", index=False)
    model = load_model(tmp_path / "rig.toml")
    wanted = simulate(model, tmp_path / "motion.csv")
    export(str(tmp_path / "rig.toml"), 2, tmp_path / "x.fmu", inverse=True)
    found = follow(tmp_path / "x.fmu", tmp_path / "x", wanted, joints)
    np.testing.assert_allclose(found, np.stack([wanted[f"tau.{j}"].values for j in joints], 1), atol=1e-9)
    forward = model_equations(model, stiff=False)
    u, p = forward.starts("input"), forward.starts("parameter")
    rate = forward.functions["rate"](0, forward.functions["initial"](0, u, p), u, p)
    assert np.abs(np.array(rate)).max() < 1e-12
