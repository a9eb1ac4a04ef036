"""A drive that is late: its command, an input, reaches the joint a delay later. Closed forms, and `simulate`."""

import numpy as np
import pandas as pd
import pytest

from bench.fmu_models import Slave, write_model
from snarelab.fmu.arm import ServoGains, arm_equations
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import export, model_equations
from snarelab.identification.simulate import simulate
from snarelab.models.floating.arm import FloatingArm
from snarelab.models.model_file import load_model

LATE = 0.02
EFFECT = '{ name = "command_delay", at = "tau.joint1" }'
VALUES = {"command_delay.tau.joint1.delay": LATE}
WEIGHTLESS = (0.0, 0.0, 0.0)


def late_arm(folder, *more, joints=1, gravity=WEIGHTLESS, values=VALUES):
    effects = "[" + ", ".join([EFFECT, *(f'"{name}"' for name in more)]) + "]"
    return load_model(write_model(folder, "arm", joints, effects, values, seed=2, gravity=gravity))


def inertia_of(model):
    phi, axis = model.tree.links[0].phi, model.tree.joints[0].axis
    return axis @ np.array([[phi[4], phi[5], phi[6]], [phi[5], phi[7], phi[8]], [phi[6], phi[8], phi[9]]]) @ axis


@pytest.mark.parametrize("version", [2, 3])
def test_a_pulse_of_command_moves_the_joint_a_delay_later(tmp_path, version):
    """From rest, 3 N·m for a quarter of a second, then none: uniform acceleration, then uniform motion, both late."""
    model = late_arm(tmp_path, "sensor_gain", values=VALUES | {"sensor_gain.tau.joint1.error": 0.1})
    path = write_fmu(model_equations(model, stiff=True), tmp_path / "x.fmu", version)
    s = Slave(path, tmp_path / "x", {"solver.tolerance": 1e-12})
    words = {v.name: v.description for v in s.description.modelVariables}
    assert words["tau.joint1"] == "drive torque commanded at joint1"
    s.set({"tau.joint1": 3.0})
    # The channel reads the command, which the drive has not delivered yet.
    np.testing.assert_allclose(s.get(["sensor.tau.joint1", "delivered.joint1"]), [3.3, 0.0], atol=1e-12)
    s.step(0.25)
    gain, t = 3.0 / inertia_of(model), 0.25 - LATE
    wanted = [0.5 * gain * t**2, gain * t, 3.0]
    np.testing.assert_allclose(s.get(["q.joint1", "qd.joint1", "delivered.joint1"]), wanted, rtol=1e-7)
    s.set({"tau.joint1": 0.0})
    s.step(0.25)
    wanted = [gain * (0.5 * 0.25**2 + 0.25 * t), gain * 0.25]
    np.testing.assert_allclose(s.get(["q.joint1", "qd.joint1"]), wanted, rtol=1e-7)
    s.close()


def test_a_drive_has_had_its_command_for_ever_at_the_start(tmp_path):
    """A constant command, from the first moment on, is delivered whole, and a servo's as well."""
    model = late_arm(tmp_path)
    s = Slave(write_fmu(model_equations(model), tmp_path / "x.fmu", 2), tmp_path / "x", {"tau.joint1": 3.0})
    s.step(0.1)
    assert s.get(["delivered.joint1"])[0] == pytest.approx(3.0, rel=1e-9)
    assert s.get(["qd.joint1"])[0] == pytest.approx(0.1 * 3.0 / inertia_of(model), rel=1e-6)
    s.close()
    arm = FloatingArm(model.tree, np.zeros(10), 0, floating=False)
    equations = arm_equations(model, arm, servo=ServoGains([40.0], [3.0]))
    start = {"servo": 1.0, "start.q.joint1": 0.2, "start.qd.joint1": 0.5, "target.joint1": 0.6}
    s = Slave(write_fmu(equations, tmp_path / "y.fmu", 2), tmp_path / "y", start)
    assert s.get(["delivered.joint1"])[0] == pytest.approx(40.0 * 0.4 - 3.0 * 0.5, rel=1e-9)
    s.close()


def test_the_command_that_simulate_finds_is_the_one_that_was_given(tmp_path):
    """There and back: the arm moves as commanded, and along its motion `simulate` knows the command ahead."""
    joints = ["joint1", "joint2"]
    values = VALUES | {f"viscous_friction.{j}.coefficient": x for j, x in zip(joints, (4.0, 3.0), strict=True)}
    model = late_arm(tmp_path, "viscous_friction", joints=2, values=values)
    export(str(model.path), 2, tmp_path / "x.fmu")
    s = Slave(tmp_path / "x.fmu", tmp_path / "x")
    step, rows = 1e-3, []
    time = np.arange(4001) * step
    command = np.stack([8.0 * np.sin(2 * np.pi * (0.7 + 0.9 * time) * time), 4.0 * np.sin(2 * np.pi * 1.3 * time)], 1)
    for t, given in zip(time, command, strict=True):
        s.set({f"tau.{j}": x for j, x in zip(joints, given, strict=True)})
        rows.append([t, *s.get([f"q.{j}" for j in joints])])
        s.step(step)
    s.close()
    columns = ["time", *(f"q.{j}" for j in joints)]
    pd.DataFrame(rows, columns=columns).to_csv(tmp_path / "motion.csv", index=False, float_format="%.12g")
    found = simulate(model, tmp_path / "motion.csv")
    inner = (found["time"].values > 0.3) & (found["time"].values < 3.7)
    for k, j in enumerate(joints):
        # The FMU holds a command over its step: half a step late.
        wanted = np.interp(found["time"].values - step / 2, time, command[:, k])
        delivered = np.interp(found["time"].values - step / 2 - LATE, time, command[:, k])
        missed = (found[f"tau.{j}"].values - wanted)[inner]
        assert np.std(missed) < 0.01 * np.std(wanted), j
        assert np.std((wanted - delivered)[inner]) > 0.1 * np.std(wanted)


def test_following_a_motion_the_torque_is_the_delivered_one(tmp_path):
    """It lags the command that `simulate` finds by the delay, and the export says so."""
    model = late_arm(tmp_path, "viscous_friction", values=VALUES | {"viscous_friction.joint1.coefficient": 2.0})
    time = np.arange(3000) * 1e-3
    q, w = np.sin(2 * np.pi * 0.9 * time), 2 * np.pi * 0.9
    pd.DataFrame({"time": time, "q.joint1": q}).to_csv(tmp_path / "motion.csv", index=False, float_format="%.12g")
    with pytest.warns(UserWarning, match=r"tau.joint1 is the torque delivered: its command leads it by command_delay"):
        export(str(model.path), 2, tmp_path / "x.fmu", inverse=True)
    s = Slave(tmp_path / "x.fmu", tmp_path / "x")
    (words,) = (v.description for v in s.description.modelVariables if v.name == "tau.joint1")
    assert words.endswith("its command leads it by command_delay.tau.joint1.delay")
    torque = []
    for k in range(len(time)):
        s.set({"q.joint1": q[k], "qd.joint1": w * np.cos(w * time[k]), "qdd.joint1": -(w**2) * q[k]})
        torque.append(s.get(["tau.joint1"])[0])
        s.step(1e-3)
    s.close()
    needed = 2.0 * w * np.cos(w * time) - inertia_of(model) * w**2 * q
    np.testing.assert_allclose(torque, needed, atol=1e-9)
    found = simulate(model, tmp_path / "motion.csv")
    given = np.interp(found["time"].values + LATE, time, needed)
    inner = (found["time"].values > 0.3) & (found["time"].values < 2.7)
    np.testing.assert_allclose(found["tau.joint1"].values[inner], given[inner], atol=0.01 * float(np.std(given)))
