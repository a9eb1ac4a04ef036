"""The torque of a model with many effects, against hand-written formulas."""

import numpy as np
import pytest
from moving_arm import PERIOD, build, jacobian, motion, placed
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from bench.arm import random_arm
from snarelab.errors import InputError
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf


def test_torque_of_plain_effects_is_the_sum_by_hand(arm, experiment):
    """Sensors read what all the others add up to, wherever they are listed, and one another in the order listed."""
    effects = placed(
        ("sensor_bias", "tau.joint1"),
        ("viscous_friction", "joint1"),
        ("sensor_gain", "tau.joint1"),
        ("coulomb_friction", "joint1"),
        ("load_dependent_friction", "joint2"),
        ("harness_stiffness", "joint3"),
        ("sensor_gain", "tau.joint2"),
        ("sensor_bias", "tau.joint2"),
    )
    assembly = build(arm, experiment, effects)
    values = {
        "viscous_friction.joint1": {"coefficient": 2.5},
        "coulomb_friction.joint1": {"level": 4.0},
        "load_dependent_friction.joint2": {"coefficient": 0.1},
        "sensor_bias.tau.joint1": {"offset": 1.5},
        "sensor_gain.tau.joint1": {"error": 0.2},
        "sensor_gain.tau.joint2": {"error": -0.1},
        "sensor_bias.tau.joint2": {"offset": 0.7},
    }
    theta = np.array([values.get(f"{s.effect}.{s.at}", {}).get(s.name, 0.0) for s in assembly.slots])
    assert np.count_nonzero(theta) == len(values)
    tau = assembly.torque(experiment, theta)
    m = experiment.motion
    load = experiment.body.torque(m.q, m.qd, m.qdd, arm[0].phi)
    moving = np.abs(m.qd) > 0.002 * np.abs(m.qd).max(axis=0)
    one = (load[:, 0] + 2.5 * m.qd[:, 0] + 4.0 * np.sign(m.qd[:, 0]) + 1.5) * 1.2
    two = (load[:, 1] + 0.1 * np.abs(load[:, 1]) * np.sign(m.qd[:, 1])) * 0.9 + 0.7
    np.testing.assert_allclose(tau[moving[:, 0], 0], one[moving[:, 0]], rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(tau[moving[:, 1], 1], two[moving[:, 1]], rtol=1e-2, atol=1e-2)
    np.testing.assert_allclose(tau[:, 2], load[:, 2], atol=1e-9)


def test_a_late_torque_sensor_shows_the_torque_of_a_moment_ago(arm, experiment):
    assembly = build(arm, experiment, placed(("sensor_delay", "tau.joint2")))
    m, delay = experiment.motion, 4 * PERIOD
    tau = assembly.torque(experiment, np.array([delay]))[:, 1]
    load = experiment.body.torque(m.q, m.qd, m.qdd, arm[0].phi)[:, 1]
    middle = np.arange(50, len(load) - 50)
    np.testing.assert_allclose(tau[middle], load[middle - 4], atol=1e-3 * np.ptp(load))


def test_a_late_encoder_is_behind_the_torque_of_every_joint(arm, experiment):
    """The torque of all joints is that of the motion with this joint a moment ahead, and so is its own friction."""
    effects = placed(("viscous_friction", "joint2"), ("sensor_delay", "q.joint2"))
    assembly = build(arm, experiment, effects)
    m, late = experiment.motion, 2
    tau = assembly.torque(experiment, np.array([2.5, late * PERIOD]))
    ahead = [x.copy() for x in (m.q, m.qd, m.qdd)]
    for x in ahead:
        x[:-late, 1] = x[late:, 1]
    load = experiment.body.torque(*ahead, arm[0].phi)
    load[:, 1] += 2.5 * ahead[1][:, 1]
    still = experiment.body.torque(m.q, m.qd, m.qdd, arm[0].phi)
    still[:, 1] += 2.5 * m.qd[:, 1]
    middle = slice(50, len(load) - 50)
    for channel in range(3):
        # First order in what the joint moved meanwhile.
        change, missed = (np.std((x - load)[middle, channel]) for x in (still, tau))
        assert missed < 0.1 * change, (channel, missed, change)


def test_a_late_encoder_of_one_joint_whose_inertia_is_free_makes_the_torque_early(tmp_path):
    drawn = random_arm(np.random.default_rng(3), 1, 0.4)
    (tmp_path / "arm.urdf").write_text(drawn.urdf())
    tree = load_urdf(tmp_path / "arm.urdf", (0.3, -0.2, -9.81))
    body = RigidBody(tree)
    recorded, base = Experiment(motion([tree.joints[0].kind]), body), base_parameters(body)
    effects = placed(("sensor_delay", "q.joint1"))
    assembly = TorqueModel(tree, effects, base, scales([recorded]), {})
    heavier = 1.7 * base.matrix @ tree.links[0].phi
    tau = assembly.torque(recorded, np.append(heavier, 4 * PERIOD))[:, 0]
    m = recorded.motion
    load = 1.7 * body.torque(m.q, m.qd, m.qdd, tree.links[0].phi)[:, 0]
    middle = np.arange(50, len(load) - 50)
    np.testing.assert_allclose(tau[middle], load[middle + 4], atol=1e-3 * np.ptp(load))


def test_a_flexible_joint_is_the_rigid_body_moved_by_the_twist(arm, experiment):
    """Twist by scipy, then the rigid body's torque where the link then is; the model is linear in the twist."""
    m, body, phi = experiment.motion, experiment.body, arm[0].phi
    stiffness, damping = 30000.0, 300.0
    load, inertia = body.torque(m.q, m.qd, m.qdd, phi)[:, 1], body.mass_matrix(m.q)[:, 1, 1]
    load_at, inertia_at = CubicSpline(m.time, load), CubicSpline(m.time, inertia)

    def rate(t, x):
        return [x[1], (load_at(t) - damping * x[1] - stiffness * x[0]) / inertia_at(t)]

    start = [load[0] / stiffness, 0.0]
    twist, speed = solve_ivp(rate, (0, m.time[-1]), start, t_eval=m.time, rtol=1e-9, atol=1e-11).y
    moved = [x.copy() for x in (m.q, m.qd, m.qdd)]
    for x, change in zip(moved, (twist, speed, (load - damping * speed - stiffness * twist) / inertia), strict=True):
        x[:, 1] -= change
    wanted = body.torque(*moved, phi) - body.torque(m.q, m.qd, m.qdd, phi)
    assembly = build(arm, experiment, placed(("joint_elasticity", "joint2")))
    state = assembly.evaluate(experiment, np.array([stiffness, damping]))
    for c in range(3):
        found = state.tau[:, c] - state.load[:, c]
        assert np.linalg.norm(found - wanted[:, c]) < 0.015 * np.linalg.norm(wanted[:, c]), c


def test_payload_is_a_heavier_arm(arm, experiment):
    """A point mass at the last link's centre of mass and beyond, added to its inertia by hand."""
    assembly = build(arm, experiment, placed(("payload_mass", "link3")))
    theta = np.array([{"mass": 2.0, "x": 0.1, "y": 0.0, "z": -0.2}[s.name] for s in assembly.slots])
    phi = arm[0].phi.copy()
    point = phi[21:24] / phi[20] + [0.1, 0.0, -0.2]
    inertia = point @ point * np.eye(3) - np.outer(point, point)
    phi[20:30] += 2.0 * np.concatenate([[1.0], point, inertia[np.triu_indices(3)]])
    m = experiment.motion
    wanted = experiment.body.torque(m.q, m.qd, m.qdd, phi)
    np.testing.assert_allclose(assembly.torque(experiment, theta), wanted, atol=1e-8 * np.abs(wanted).max())


def test_a_gap_restarts_hidden_states(arm):
    tree, body = arm
    kinds = [j.kind for j in tree.joints]
    joined = Experiment(motion(kinds, 900, (slice(0, 400), slice(400, 900))), body)
    alone = [Experiment(motion(kinds, 400), body), Experiment(motion(kinds, 500, first=400), body)]
    whole = Experiment(motion(kinds, 900), body)
    effects = placed(
        ("joint_elasticity", "joint2"),
        ("presliding_hysteresis", "joint1"),
        ("sensor_delay", "tau.joint1"),
        ("sensor_delay", "q.joint3"),
        ("viscous_friction", "joint1"),
        ("viscous_friction", "joint3"),
    )
    assembly = build(arm, joined, effects)
    theta = np.array([{"stiffness": 4000.0, "damping": 30.0, "delay": 0.02}.get(s.name, 3.0) for s in assembly.slots])
    tau, columns = assembly.torque(joined, theta), jacobian(assembly, joined, theta)
    for e, part in zip(alone, (slice(0, 400), slice(400, 900)), strict=True):
        np.testing.assert_allclose(tau[part], assembly.torque(e, theta), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(columns[part], jacobian(assembly, e, theta), rtol=1e-7, atol=1e-7)
    unbroken = assembly.torque(whole, theta)
    assert np.all(np.max(np.abs(tau - unbroken)[380:420], axis=0) > 1e-3)  # where nothing restarts, it shows


def test_slots_name_unit_bounds_and_start(arm, experiment):
    assembly = build(
        arm,
        experiment,
        placed(
            ("stribeck_friction", "joint1"),
            ("viscous_friction", "joint3"),
            ("sensor_bias", "tau.joint3"),
        ),
        values={"viscous_friction.joint3.coefficient": 7.0, "stribeck_friction.joint1.speed": 1e9},
    )
    slots = {s.key: s for s in assembly.slots}
    peak = np.abs(experiment.motion.qd[:, 0]).max()
    speed = slots["stribeck_friction.joint1.speed"]
    assert (speed.unit, speed.low, speed.high) == ("rad/s", pytest.approx(0.005 * peak), pytest.approx(peak))
    assert speed.start == speed.high  # a known value is a start, moved inside
    assert slots["stribeck_friction.joint1.level"].unit == "N*m"
    assert slots["viscous_friction.joint3.coefficient"].unit == "N*s/m"
    assert slots["viscous_friction.joint3.coefficient"].start == 7.0
    assert slots["sensor_bias.tau.joint3.offset"].unit == "N"


def test_what_is_held_is_not_fitted_but_acts(arm, experiment):
    effects = placed(("stribeck_friction", "joint1", "speed"), ("viscous_friction", "joint2"))
    known = {"stribeck_friction.joint1.speed": 0.5}
    assembly = build(arm, experiment, effects, values=known)
    assert [s.key for s in assembly.slots] == ["stribeck_friction.joint1.level", "viscous_friction.joint2.coefficient"]
    m, theta = experiment.motion, np.array([3.0, 0.0])
    load = experiment.body.torque(m.q, m.qd, m.qdd, arm[0].phi)[:, 0]
    v = m.qd[:, 0]
    extra = assembly.torque(experiment, theta)[:, 0] - load
    clear = np.abs(v) > 0.01 * np.abs(v).max()
    np.testing.assert_allclose(extra[clear], 3.0 * np.sign(v[clear]) * np.exp(-((v[clear] / 0.5) ** 2)), atol=1e-3)
    saved = assembly.values(theta)
    assert saved["stribeck_friction.joint1.speed"] == 0.5
    assert saved["stribeck_friction.joint1.level"] == 3.0
    again = build(arm, experiment, effects, values=saved)
    np.testing.assert_array_equal(again.start, theta)


def test_a_link_effect_beside_free_inertia_is_refused(arm, experiment):
    with pytest.raises(InputError, match=r"payload_mass at link3 with inertia = 'free'"):
        build(arm, experiment, placed(("payload_mass", "link3")), base_parameters(arm[1]))


def test_no_model_is_evaluated_twice_at_the_same_parameters(arm, experiment, monkeypatch):
    """Of two models in turn, as a report compares them; another inertia is another model."""
    counted, worked_out = [], TorqueModel._evaluate
    monkeypatch.setattr(TorqueModel, "_evaluate", lambda self, *own: counted.append(self) or worked_out(self, *own))
    models = [build(arm, experiment, placed((name, "joint1"))) for name in ("viscous_friction", "coulomb_friction")]
    for _ in range(3):
        torques = [model.torque(experiment, model.start + 1.0) for model in models]
    assert counted == models
    assert not np.allclose(torques[0], torques[1])
    models[0].phi = 2 * models[0].phi
    again = models[0].torque(experiment, models[0].start + 1.0)
    assert counted == [*models, models[0]]
    assert not np.allclose(again, torques[0])
