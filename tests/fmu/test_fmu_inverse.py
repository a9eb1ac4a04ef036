"""The loop closed: a model found by diagnosis, exported, reproduces along a motion what `simulate` and the fit say."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from inverse_fmu import follow, parted
from scipy.spatial.transform import Rotation

from bench.fmu_models import Slave, everywhere, write_model
from snarelab.cli import main
from snarelab.fmu.export import export, model_equations
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import load_experiments, scales
from snarelab.identification.fitting.floating_terms import base_signals
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


@pytest.mark.parametrize("version", [2, 3])
def test_follows_as_simulate_does_hidden_states_and_sensors_included(tmp_path, version):
    values = everywhere("coulomb_friction", "level", [3.0, 2.0]) | {
        "speed_scale.joint1": 4.0,
        "speed_scale.joint2": 5.0,
    }
    values |= {"presliding_hysteresis.joint1.level": 1.5, "presliding_hysteresis.joint1.travel": 0.02}
    values |= {"presliding_hysteresis.joint1.by_load": 0.05}
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
    assert parted(path, version, t, q) < 1e-9


@pytest.mark.slow
@pytest.mark.usefixtures("each_diagnosis_once")
def test_diagnose_export_and_simulate_reproduce_the_improved_fit(tmp_path):
    """The bundled arm: what its model leaves out is found, and its FMU has the residual that diagnose tells."""
    bundled = Path(str(files("snarelab.studies"))) / "bundled"
    hold, new = bundled / "holdout.csv", tmp_path / "new.toml"
    given = ["diagnose", bundled / "arm3.toml", bundled / "train.csv", "--holdout", hold, "--json", tmp_path / "d.json"]
    assert main([str(x) for x in [*given, "--save-model", new]]) == 0
    told = json.loads((tmp_path / "d.json").read_text())
    assert told["verdict"] == "missing_physics"
    assert told["fit"]["tau.joint2"]["holdout"]["rms_after"] < 0.3 * told["fit"]["tau.joint2"]["holdout"]["rms_before"]
    model = load_model(new)
    joints = list(model.joints)
    assert any(p.effect.states for p in model.effects)
    export(str(new), 3, tmp_path / "x.fmu", inverse=True)
    kinds: dict[str, JointKind] = {j.name: j.kind for j in model.tree.joints}
    recorded = condition(read_recording(hold, {}, kinds), joints, told["band"]["value"])
    found = follow(tmp_path / "x.fmu", tmp_path / "x", simulate(model, hold), joints)
    for k, joint in enumerate(joints):
        fit = told["fit"][f"tau.{joint}"]["holdout"]
        residual = recorded.to_band(recorded.tau[:, k] - found[:, k])
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(fit["rms_after"], rel=1e-9)
    # And the arm itself carries the new physics, under its own name.
    export(str(new), 3, tmp_path / "arm.fmu")
    s = Slave(tmp_path / "arm.fmu", tmp_path / "arm")
    assert {f"{p.key}.{x.name}" for p in model.effects for x in p.effect.parameters} <= set(s.references)
    s.close()


def test_a_late_encoder_reads_the_true_motion_late(tmp_path):
    """The motion given is the true one: torque does not know of the encoder, which reads 8 ms late."""
    values = {"viscous_friction.joint1.coefficient": 2.0, "sensor_delay.q.joint1.delay": 0.008}
    late = write_model(tmp_path, "arm", 1, '["viscous_friction", { name = "sensor_delay", at = "q.joint1" }]', values)
    bare = write_model(tmp_path, "bare", 1, '["viscous_friction"]', values)
    t, q, qd, qdd = motion(1, 2.0, 0)
    slaves = []
    for path in (late, bare):
        export(str(path), 2, tmp_path / f"{path.stem}.fmu", inverse=True)
        slaves.append(Slave(tmp_path / f"{path.stem}.fmu", tmp_path / path.stem, {"q.joint1": q[0, 0]}))
    found = np.empty((len(t), 3))
    for k in range(len(t)):
        for s in slaves:
            s.set({"q.joint1": q[k, 0], "qd.joint1": qd[k, 0], "qdd.joint1": qdd[k, 0]})
        found[k] = [*slaves[0].get(["tau.joint1", "sensor.q.joint1"]), *slaves[1].get(["tau.joint1"])]
        for s in slaves:
            s.step(t[1])
    np.testing.assert_array_equal(found[:, 0], found[:, 2])
    settled = t > 0.1
    read = np.interp(t[settled] - 0.008, t, q[:, 0])  # linear between samples, as the FMU takes the motion
    np.testing.assert_allclose(found[settled, 1], read, atol=2e-4 * np.ptp(q))
    for s in slaves:
        s.close()


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


def test_follows_on_a_rig_with_slings_slides_and_booms(tmp_path):
    """All effects of a rig, two with hidden states, along a motion: as `simulate` has it."""
    joints = [f"joint{k}" for k in range(1, 8)]
    places = {
        "slide_friction": ("joint3", {"coulomb_level": 20.0, "coulomb_speed": 0.02, "stribeck_level": 5.0,
                                      "stribeck_speed": 0.01, "stribeck_ratio": 4.0, "viscous_coefficient": 8.0}),
        "sling_tension_error": ("sling5", {"share": 0.03, "lag_loss": 20.0}),
        "suspension_sway": ("sling6", {"stiffness": 30.0, "lag": 0.4}),
        "hang_point_clearance": ("sling8", {"clearance": 0.02}),
        "link_torsion": ("link3", {"torque": 40.0, "radius": 2.0}),
        "link_bending": ("link4", {"torque": -30.0, "radius": 1.5}),
        "suspension_stiffness": ("slings", {"stiffness": 60.0}),
    }  # fmt: skip
    values = {f"{name}.{at}.{k}": v for name, (at, given) in places.items() for k, v in given.items()}
    listed = ", ".join(f'{{ name = "{name}", at = "{at}" }}' for name, (at, _) in places.items())
    lines = ['name = "rig"', 'system = "zero_g_rig"', f"effects = [{listed}]", "[parameters]"]
    lines += [f'"{k}" = {v!r}' for k, v in values.items()]
    (tmp_path / "rig.toml").write_text("\n".join(lines) + "\n")
    t, q, _, _ = motion(7, 2.0, 0)
    columns = {"time": t} | {f"q.{j}": 0.2 * q[:, k] for k, j in enumerate(joints)}
    pd.DataFrame(columns | {f"tau.{j}": 1 + 0 * t for j in joints}).to_csv(tmp_path / "motion.csv", index=False)
    wanted = simulate(load_model(tmp_path / "rig.toml"), tmp_path / "motion.csv")
    export(str(tmp_path / "rig.toml"), 2, tmp_path / "x.fmu", inverse=True)
    found = follow(tmp_path / "x.fmu", tmp_path / "x", wanted, joints)
    for k, j in enumerate(joints):
        tau = wanted[f"tau.{j}"].values
        np.testing.assert_allclose(found[:, k], tau, rtol=0, atol=1e-9 * np.abs(tau).max())


def test_follows_a_floating_base_with_its_effects(tmp_path):
    """Joints' torques and the base's balance of momentum along a given motion: as the fit has them."""
    values = {"external_torque.base.x": 0.2, "external_torque.base.z": -0.1, "viscous_friction.joint2.coefficient": 3.0}
    values |= dict.fromkeys(("external_torque.base.y",), 0.0)
    sloshing = {"mass_x": 20.0, "mass_y": 30.0, "mass_z": 10.0, "x": 0.2, "y": 0.1, "z": -0.3, "frequency": 0.8}
    bending = {"inertia_x": 30.0, "inertia_y": 20.0, "inertia_z": 40.0, "frequency": 0.6, "damping": 0.05}
    rubbing = {"loss_x": 0.1, "loss_y": 0.0, "loss_z": 0.2, "coulomb_x": 0.01, "coulomb_y": 0.02, "coulomb_z": 0.0}
    for name, given in (
        ("propellant_slosh", sloshing | {"damping": 0.02}),
        ("flexible_appendage", bending),
        ("wheel_friction", rubbing | {"inertia": 0.3}),
    ):
        values |= {f"{name}.base.{k}": v for k, v in given.items()}
    listed = '"external_torque", "propellant_slosh", "flexible_appendage", "wheel_friction"'
    lines = ['system = "free_floating_arm"', f'effects = [{listed}, {{ name = "viscous_friction", at = "joint2" }}]']
    lines += ["[parameters]", *(f'"{k}" = {v!r}' for k, v in values.items())]
    (tmp_path / "ets.toml").write_text("\n".join(lines) + "\n")
    model = load_model(tmp_path / "ets.toml")
    joints, n = [f"joint{k}" for k in range(1, 7)], 6
    t, q, _, _ = motion(n, 6.0, 0)
    twist = 0.02 * motion(6, 6.0, 1)[1]
    told = np.where(t > 1.5, 0.3 * np.sin(2.0 * (t - 1.5)), 0.0)[:, None] * [1.0, -0.5, 0.7]
    columns = {"time": t} | {f"q.{j}": 0.3 * q[:, k] for k, j in enumerate(joints)}
    columns |= {f"tau.{j}": 1 + 0 * t for j in joints} | {f"quat.base.{a}": float(a == "w") + 0 * t for a in "wxyz"}
    columns |= {
        f"{x}.base.{a}": twist[:, 3 * i + k] for i, x in enumerate(("vel", "omega")) for k, a in enumerate("xyz")
    }
    columns |= {f"torque.wheels.{a}": told[:, k] for k, a in enumerate("xyz")}
    pd.DataFrame(columns).to_csv(tmp_path / "motion.csv", index=False)
    (experiment,) = load_experiments(model, [tmp_path / "motion.csv"], RigidBody(model.tree))
    assembly = TorqueModel(model.tree, model.effects, None, scales([experiment]), model.values)
    wanted = assembly.torque(experiment, np.array([model.values[s.key] for s in assembly.slots]))
    wanted += experiment.carried  # the fit has the base's own momentum on the measured side
    recorded, read = experiment.motion, base_signals(experiment)
    wheels = np.column_stack([np.interp(recorded.time, t, x) for x in told.T])
    wanted[:, 3:6] -= wheels + np.cross(read["spin"], read["impulse"])

    export(str(tmp_path / "ets.toml"), 3, tmp_path / "x.fmu", inverse=True)
    turned = Rotation.from_rotvec([0.3, -0.5, 0.8])  # the base's attitude must not matter
    given = {f"{x}.{j}": y[:, 6 + k] for x, y in (("q", recorded.q), ("qd", recorded.qd), ("qdd", recorded.qdd))
             for k, j in enumerate(joints)}  # fmt: skip
    vectors = {
        "vel": recorded.qd[:, :3],
        "omega": read["spin"],
        "acc": read["acceleration"],
        "alpha": read["spin_rate"],
    }
    given |= {f"{x}.base.{a}": turned.apply(y)[:, k] for x, y in vectors.items() for k, a in enumerate("xyz")}
    quaternion = turned.as_quat(scalar_first=True)
    given |= {f"quat.base.{a}": np.full(len(wheels), quaternion[k]) for k, a in enumerate("wxyz")}
    given |= {f"torque.wheels.{a}": wheels[:, k] for k, a in enumerate("xyz")}
    s = Slave(tmp_path / "x.fmu", tmp_path / "x", {k: v[0] for k, v in given.items()})
    found = np.empty_like(wanted)
    names = [f"{x}.base.{a}" for x in ("force", "torque") for a in "xyz"] + [f"tau.{j}" for j in joints]
    for k in range(len(found)):
        s.set({name: x[k] for name, x in given.items()})
        found[k] = s.get(names)
        s.step(recorded.period)
    s.close()
    for column, name in enumerate(names):
        size = np.abs(wanted[:, column]).max()
        np.testing.assert_allclose(found[:, column], wanted[:, column], rtol=0, atol=1e-9 * size, err_msg=name)


def test_follows_an_arm_with_elastic_links(tmp_path):
    """Torsion in one link and bending in two, beside an elastic joint: as `simulate` has it."""
    effects = """[{ name = "link_torsion", at = "link1" }, "link_bending", { name = "joint_elasticity", at = "joint2" },
        { name = "sensor_delay", at = "tau.joint1" }]"""
    values = {"link_torsion.link1.stiffness": 900.0, "link_torsion.link1.damping": 3.0}
    values |= {f"link_bending.link{k}.stiffness": 2000.0 / k for k in (1, 2)}
    values |= {f"link_bending.link{k}.damping": 5.0 / k for k in (1, 2)}
    values |= {"joint_elasticity.joint2.stiffness": 900.0, "joint_elasticity.joint2.damping": 4.0}
    path = write_model(tmp_path, "arm", 3, effects, values | {"sensor_delay.tau.joint1.delay": 0.012})
    t, q, _, _ = motion(3, 3.0, 0)
    assert parted(path, 2, t, q) < 1e-9
