"""The self-contained arm against other engines: accelerations, motion, order, floating base, springs, sensors."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from bench.fmu_models import accelerations, everywhere, made_slave, write_model
from snarelab.cosim.participants.floating_arm import FloatingArmParticipant
from snarelab.errors import InputError
from snarelab.fmu.arm import ServoGains, arm_equations
from snarelab.fmu.elements import ELEMENTS
from snarelab.fmu.export import model_equations
from snarelab.models.effects import get_effect
from snarelab.models.floating.arm import FloatingArm
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.floating.joint_drive import Drive
from snarelab.models.model import Model, PlacedEffect
from snarelab.models.model_file import load_model

ENGINE: Any = pin  # its stubs lack most names
GRAVITY = np.array([0.3, -1.0, -9.7])
VISCOUS, COULOMB = np.array([12.0, 10.0, 6.0, 2.0, 1.0, 0.5]), np.array([6.0, 5.0, 3.0, 1.0, 0.5, 0.2])


def engine(path):
    """pinocchio's model and data of the URDF beside a model file."""
    model = ENGINE.buildModelFromXML(Path(path).with_suffix(".urdf").read_text())
    model.gravity = ENGINE.Motion(GRAVITY, np.zeros(3))
    return model, model.createData()


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """Six joints, viscous friction and Coulomb friction smooth enough for one step of 1 ms."""
    folder = tmp_path_factory.mktemp("six")
    values = everywhere("viscous_friction", "coefficient", VISCOUS) | everywhere("coulomb_friction", "level", COULOMB)
    values |= {f"speed_scale.joint{k}": 1000.0 for k in range(1, 7)}
    path = write_model(folder, "six", 6, '["viscous_friction", "coulomb_friction"]', values, gravity=GRAVITY)
    return folder, path, model_equations(load_model(path), stiff=False)


def friction6(qd):
    return VISCOUS * qd + COULOMB * np.tanh(qd / (3e-4 * 1000.0))


@pytest.mark.parametrize("version", [2, 3])
def test_motion_within_1e_9_of_dop853_on_another_engine(six, version):
    folder, path, equations = six
    model, data = engine(path)
    q0, qd0 = np.array([0.3, -0.4, 0.5, 0.2, -0.3, 0.1]), np.array([0.2, 0.1, -0.3, 0.4, 0.5, -0.6])
    tau = np.array([20.0, -30.0, 10.0, 5.0, -2.0, 1.0])

    def rate(t, x):
        return np.concatenate([x[6:], ENGINE.aba(model, data, x[:6], x[6:], tau - friction6(x[6:]))])

    wanted = solve_ivp(rate, (0, 0.2), np.concatenate([q0, qd0]), "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    start = {f"start.q.joint{k + 1}": q0[k] for k in range(6)} | {f"start.qd.joint{k + 1}": qd0[k] for k in range(6)}
    s = made_slave(folder, equations, version, **start, **{f"tau.joint{k + 1}": tau[k] for k in range(6)})
    for _ in range(200):
        s.step(1e-3)
    names = [f"{n}.joint{k}" for n in ("q", "qd") for k in range(1, 7)]
    np.testing.assert_allclose(s.get(names), wanted, rtol=0, atol=1e-9)
    s.close()


def test_runge_kutta_is_of_order_four(six):
    folder, _, equations = six
    names = [f"q.joint{k}" for k in range(1, 7)]
    ends = []
    for step in (2e-3, 1e-3, 5e-4, 1e-4):
        s = made_slave(folder, equations, **{"solver.step": step, "tau.joint1": 30.0, "start.qd.joint2": 0.3})
        s.step(0.4)
        ends.append(s.get(names))
        s.close()
    errors = [np.abs(end - ends[-1]).max() for end in ends[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.5) & (orders < 5)), orders


@pytest.mark.parametrize("prismatic", [0.0, 0.5])
def test_accelerations_with_effects_that_react_on_them(tmp_path, prismatic):
    """Rotor inertia, and friction in proportion to the load, which itself depends on the acceleration."""
    values = everywhere("rotor_inertia", "inertia", [0.7, 0.2, 0.4]) | everywhere(
        "load_dependent_friction", "coefficient", [0.2, 0.5, 0.3]
    )
    values |= {"payload_mass.link3.mass": 2.0, "payload_mass.link3.x": 0.1, "payload_mass.link3.y": 0.0}
    values |= {"payload_mass.link3.z": -0.05} | {f"speed_scale.joint{k}": 1.0 for k in (1, 2, 3)}
    effects = '["rotor_inertia", "load_dependent_friction", { name = "payload_mass", at = "link3" }]'
    path = write_model(tmp_path, "arm", 3, effects, values, seed=8, prismatic=prismatic, gravity=GRAVITY)
    model, data = engine(path)
    point = model.inertias[3].lever + np.array([0.1, 0.0, -0.05])  # the far end of a last link is its centre of mass
    model.inertias[3] += ENGINE.Inertia(2.0, point, np.zeros((3, 3)))
    rng = np.random.default_rng(1)
    equations = model_equations(load_model(path))
    for _ in range(5):
        q, qd, tau = rng.normal(size=(3, 3))
        tau *= 20.0
        qdd = accelerations(tmp_path, equations, q, qd, tau)
        load = ENGINE.rnea(model, data, q, qd, qdd)
        taken = np.array([0.7, 0.2, 0.4]) * qdd + np.array([0.2, 0.5, 0.3]) * np.abs(load) * np.tanh(qd / 3e-4)
        np.testing.assert_allclose(load + taken, tau, rtol=0, atol=1e-9 * np.abs(tau).max())


def test_wrench_and_twist_of_the_tip(tmp_path):
    path = write_model(tmp_path, "arm", 4, "[]", {}, seed=5, gravity=GRAVITY)
    model, data = engine(path)
    rng = np.random.default_rng(0)
    q, qd, tau = rng.normal(size=(3, 4))
    wrench = rng.normal(size=6)
    start = {f"start.q.joint{k + 1}": q[k] for k in range(4)} | {f"start.qd.joint{k + 1}": qd[k] for k in range(4)}
    start |= {f"tau.joint{k + 1}": tau[k] for k in range(4)}
    start |= {f"{n}.tip.{a}": wrench[3 * i + k] for i, n in enumerate(("force", "torque")) for k, a in enumerate("xyz")}
    s = made_slave(tmp_path, model_equations(load_model(path)), **start)
    ENGINE.forwardKinematics(model, data, q, qd)
    pose = data.oMi[4]
    jacobian = ENGINE.computeJointJacobian(model, data, q, 4)
    world = np.kron(np.eye(2), pose.rotation) @ jacobian
    np.testing.assert_allclose(s.get([f"pos.tip.{a}" for a in "xyz"]), pose.translation, atol=1e-13)
    twist = s.get([f"{n}.tip.{a}" for n in ("vel", "omega") for a in "xyz"])
    np.testing.assert_allclose(twist, world @ qd, atol=1e-12)
    x, y, z, w = ENGINE.Quaternion(pose.rotation).coeffs()
    found = s.get([f"quat.tip.{a}" for a in "wxyz"])
    np.testing.assert_allclose(found * np.sign(w), [w, x, y, z], atol=1e-12)
    qdd = ENGINE.aba(model, data, q, qd, tau + world.T @ wrench)
    np.testing.assert_allclose(s.get([f"qdd.joint{k}" for k in range(1, 5)]), qdd, atol=1e-9)
    # Directional derivative: acceleration by a torque is a column of the inverse inertia.
    column = s.derivative([f"qdd.joint{k}" for k in range(1, 5)], ["tau.joint2"], [2.0])
    inverse = np.linalg.inv(ENGINE.crba(model, data, q))
    np.testing.assert_allclose(column, 2.0 * inverse[:, 1], rtol=1e-9)
    s.close()


def test_floating_base_keeps_its_momentum_and_agrees_with_another_engine(tmp_path):
    """ETS-VII's arm flails: no momentum appears, and base and joints accelerate as pinocchio says."""
    arm = ets_vii()
    equations = ELEMENTS["ets_vii_arm"]()
    tau = np.array([0.4, -0.3, 0.2, 0.1, -0.05, 0.03])
    start = {f"tau.joint{k + 1}": tau[k] for k in range(6)}
    s = made_slave(tmp_path, equations, **start)
    model = ENGINE.Model()
    base = model.addJoint(0, ENGINE.JointModelFreeFlyer(), ENGINE.SE3.Identity(), "base")

    def body(phi):
        lever = phi[1:4] / phi[0]
        about = np.array([[phi[4], phi[5], phi[6]], [phi[5], phi[7], phi[8]], [phi[6], phi[8], phi[9]]])
        return ENGINE.Inertia(phi[0], lever, about - phi[0] * (lever @ lever * np.eye(3) - np.outer(lever, lever)))

    model.appendBodyToJoint(base, body(arm.base), ENGINE.SE3.Identity())
    for joint, link in zip(arm.tree.joints, arm.tree.links, strict=True):
        pose = ENGINE.SE3(joint.rotation, joint.translation)
        added = model.addJoint(base + 1 + joint.parent, ENGINE.JointModelRZ(), pose, joint.name)
        model.appendBodyToJoint(added, body(link.phi), ENGINE.SE3.Identity())
    model.gravity = ENGINE.Motion.Zero()
    data = model.createData()
    for _ in range(500):
        s.step(1e-2)
    names = [f"{n}.base.{a}" for n, axes in (("pos", "xyz"), ("quat", "wxyz")) for a in axes]
    pose = s.get(names)
    place = np.concatenate([pose[:3], pose[[4, 5, 6, 3]], s.get([f"q.joint{k}" for k in range(1, 7)])])
    rotation = ENGINE.Quaternion(pose[[4, 5, 6, 3]]).toRotationMatrix()
    twist = s.get([f"{n}.base.{a}" for n in ("vel", "omega") for a in "xyz"])
    rates = np.concatenate(
        [rotation.T @ twist[:3], rotation.T @ twist[3:], s.get([f"qd.joint{k}" for k in range(1, 7)])]
    )
    momentum = ENGINE.computeCentroidalMomentum(model, data, place, rates)
    size = np.abs(rates[6:]).max() * 20.0  # an arm of 140 kg at these rates carries this much, [kg m²/s]
    assert np.abs(momentum.vector).max() < 1e-9 * size
    assert np.abs(twist).max() > 1e-4
    wanted = ENGINE.aba(model, data, place, rates, np.concatenate([np.zeros(6), tau]))[6:]
    np.testing.assert_allclose(s.get([f"qdd.joint{k}" for k in range(1, 7)]), wanted, rtol=1e-9)
    s.close()


def test_a_missing_value_is_named(tmp_path):
    path = write_model(tmp_path, "arm", 1, '["coulomb_friction"]', {})
    with pytest.raises(InputError, match=r"no value for 'coulomb_friction.joint1.level' \(1 missing\)"):
        model_equations(load_model(path))


def test_friction_turns_over_by_the_joints_speed_limit_where_no_recording_says(tmp_path):
    path = write_model(tmp_path, "arm", 1, '["coulomb_friction"]', {"coulomb_friction.joint1.level": 1.0})
    model = load_model(path)
    (scale,) = [v for v in model_equations(model).of("parameter") if v.name == "speed_scale.joint1"]
    limit = model.tree.joints[0].speed
    assert scale.start == (limit if np.isfinite(limit) else 1.0)
    fitted = write_model(
        tmp_path, "fitted", 1, '["coulomb_friction"]', {"coulomb_friction.joint1.level": 1.0, "speed_scale.joint1": 0.7}
    )
    (scale,) = [v for v in model_equations(load_model(fitted)).of("parameter") if v.name == "speed_scale.joint1"]
    assert scale.start == 0.7


def test_a_servo_on_a_floating_base_moves_as_the_participant_does(tmp_path):
    """The same arm, drive and wrench through another derivation and another integrator (Dormand and Prince's)."""
    path = write_model(tmp_path, "arm", 2, "[]", {}, gravity=(0, 0, 0))
    tree = load_model(path).tree
    tree = replace(tree, joints=tuple(replace(j, speed=0.5) for j in tree.joints))
    base = np.array([300.0, 0, 0, 15.0, 90.0, 2.0, 0.0, 80.0, 0.0, 110.0])
    arm = FloatingArm(tree, base, 1, tip_translation=np.array([0.1, 0.0, 0.3]))
    effects = [
        PlacedEffect(get_effect(n), j) for j in ("joint1", "joint2") for n in ("makkar_friction", "rotor_inertia")
    ]
    values = {f"rotor_inertia.{j}.inertia": 0.4 for j in ("joint1", "joint2")}
    friction = {"coulomb_level": 2.0, "coulomb_speed": 0.05, "viscous_coefficient": 3.0, "stribeck_level": 0.5}
    friction |= {"stribeck_speed": 0.05, "stribeck_ratio": 4.0}
    values |= {f"makkar_friction.{j}.{k}": v for j in ("joint1", "joint2") for k, v in friction.items()}
    first, gains = [0.3, -0.8], ([40.0, 20.0], [12.0, 6.0])
    whole = FloatingArmParticipant(arm, Drive(*gains, effects, values), q=first, servo=True)
    whole.initialize()
    model = Model(Path("x"), "servo_arm", "free_floating_arm", None, tree, "fixed", tuple(effects), {}, None, values)
    equations = arm_equations(model, arm, stiff=False, servo=ServoGains(*gains), start=first)
    given = {"servo": 1.0, "target.joint1": 0.5, "target.joint2": -0.6, "force.tip.y": 4.0, "torque.tip.x": -1.5}
    s = made_slave(tmp_path, equations, 2, **given)
    inputs = np.array([given.get(v.name, v.start) for v in whole.variables if v.causality == "input"])
    for k in range(50):
        whole.set_inputs(inputs)
        whole.step(0.01 * k, 0.01)
        s.step(0.01)
    outputs = dict(zip(whole.names("output"), whole.outputs(), strict=True))
    common = [name for name in outputs if name in s.references]
    assert len(common) == 13 + 13 + 4
    np.testing.assert_allclose(s.get(common), [outputs[name] for name in common], rtol=0, atol=2e-9)
    s.close()
