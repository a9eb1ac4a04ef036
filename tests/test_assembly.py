"""The torque of a model with many effects: against hand-written formulas, and its derivatives against differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from bench.arm import random_arm
from snarelab.errors import InputError
from snarelab.identification.fitting.assembly import Assembly
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf
from snarelab.recordings.condition import Motion

PERIOD = 5e-3
JOINTS = ("joint1", "joint2", "joint3")


def placed(*entries):
    """``("viscous_friction", "joint1")`` or with names of held parameters after it."""
    return [Placed(get_effect(name), at, tuple(hold)) for name, at, *hold in entries]


def motion(kinds, n=1200, segments=None, thinning=3, first=0):
    """Sines of every joint, exact; samples ``first`` to ``first + n`` of one endless motion."""
    t = np.asarray(PERIOD * np.arange(first, first + n), np.float64)
    size = np.array([0.15 if kind == "prismatic" else 0.8 for kind in kinds])
    q, qd, qdd = np.zeros((3, n, len(kinds)))
    for k, (amplitude, frequency) in enumerate([(1.0, 0.37), (0.4, 0.9), (0.1, 2.3)]):
        w = 2 * np.pi * frequency * (1 + 0.13 * np.arange(len(kinds)))
        angle = w * t[:, None] + 0.7 * k + np.arange(len(kinds))
        q += amplitude * size * np.sin(angle)
        qd += amplitude * size * w * np.cos(angle)
        qdd -= amplitude * size * w**2 * np.sin(angle)
    tau = 30.0 * np.cos(t[:, None] + np.arange(len(kinds)))
    temperature = np.full_like(q, 20.0)
    band = 1 / (2 * thinning * PERIOD)
    parts = segments or (slice(0, n),)
    return Motion(
        "run.csv", JOINTS[: len(kinds)], PERIOD, band, t, q, qd, qdd, tau, temperature, parts, thinning, (), 0 * q[0]
    )


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A random arm of two revolute joints and a prismatic one."""
    for seed in range(100):
        drawn = random_arm(np.random.default_rng(seed), 3, 0.4)
        if [link.kind for link in drawn.links] == ["revolute", "revolute", "prismatic"]:
            path = tmp_path_factory.mktemp("arm") / "arm.urdf"
            path.write_text(drawn.urdf())
            tree = load_urdf(path, (0.3, -0.2, -9.81))
            return tree, RigidBody(tree)
    raise AssertionError("no such arm in 100 draws")


@pytest.fixture(scope="module")
def experiment(arm):
    tree, body = arm
    return Experiment(motion([j.kind for j in tree.joints]), body)


def build(arm, experiment, effects, base=None, values=None):
    return Assembly(arm[0], effects, base, scales([experiment]), values or {})


def jacobian(assembly, experiment, theta):
    """Derivative blocks added up to one array (n, J, P)."""
    state = assembly.evaluate(experiment, theta)
    dense = np.zeros((*state.tau.shape, len(theta)))
    for block in state.blocks:
        for k, i in enumerate(block.index):
            dense[:, block.channel, i] += block.values[:, k]
    return dense


def differences(assembly, experiment, theta):
    """Central differences of the torque (n, J, P)."""
    columns = []
    for k, x in enumerate(theta):
        step = np.zeros_like(theta)
        step[k] = 1e-5 * max(abs(x), 1e-2)
        ahead, behind = (assembly.torque(experiment, theta + s) for s in (step, -step))
        columns.append((ahead - behind) / (2 * step[k]))
    return np.stack(columns, axis=2)


def errors(found, wanted):
    """Relative error of each parameter's columns over all samples and channels; some inertias move no joint at all."""
    size = np.linalg.norm(wanted, axis=(0, 1))
    assert np.mean(size > 1e-6) > 0.8
    return np.linalg.norm(found - wanted, axis=(0, 1)) / np.maximum(size, 1e-6)


INSIDE = {
    "delay": 0.011,
    "speed": 0.2,
    "mass": 1.7,
    "x": 0.05,
    "y": -0.03,
    "z": 0.12,
    "coefficient": 0.08,
    "level": 3.0,
}
"""Values away from zero, where every parameter has a say."""

_MANY = """
viscous_friction@joint1 viscous_friction@joint3 coulomb_friction@joint1 stribeck_friction@joint1
asymmetric_friction@joint2 load_dependent_friction@joint2 load_dependent_friction@joint3
position_dependent_friction@joint2 harness_stiffness@joint3 rotor_inertia@joint2 torque_ripple@joint1
presliding_hysteresis@joint3 sensor_gain@tau.joint1 sensor_delay@tau.joint2 sensor_gain@tau.joint2
sensor_bias@tau.joint2 sensor_delay@q.joint3 sensor_drift@tau.joint3
"""
MANY = placed(*(entry.split("@") for entry in _MANY.split()))
LINKS = placed(("payload_mass", "link3"), ("com_offset", "link2"), ("inertia_error", "link1"))


def inside(assembly):
    """A parameter vector strictly between the bounds, with nothing at zero."""
    rng = np.random.default_rng(5)
    start = np.array([INSIDE.get(s.name, 0.0) or s.start for s in assembly.slots])
    start = start + np.where(
        start == 0, rng.uniform(0.05, 0.15, len(start)), 0.1 * start * rng.uniform(-1, 1, len(start))
    )
    return np.clip(start, np.nan_to_num(assembly.low) * 0.999, np.nan_to_num(assembly.high) * 0.999)


def test_derivatives_of_many_effects_at_once(arm, experiment):
    assembly = build(arm, experiment, LINKS + MANY)
    theta = inside(assembly)
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        assert error < 1e-6, (slot.key, error)


def test_derivatives_with_the_inertia_free(arm, experiment):
    base = base_parameters(arm[1])
    assembly = build(arm, experiment, MANY, base)
    theta = inside(assembly)
    theta[: len(base.columns)] = base.matrix @ arm[0].phi
    assert len(theta) > len(base.columns) > 10
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        assert error < 1e-6, (slot.key, error)


def test_derivatives_behind_a_flexible_joint(arm, experiment):
    """Exact by stiffness and damping, and by all that does not feed the spring.

    Knowingly left out is the twist that more payload would cause: the twist changes the torque by a few parts in a
    hundred here, its change with the payload by no more.
    """
    effects = placed(("joint_elasticity", "joint2"), ("payload_mass", "link3", "x", "y", "z")) + MANY
    assembly = build(arm, experiment, effects)
    theta = inside(assembly)
    for k, slot in enumerate(assembly.slots):
        if slot.effect == "joint_elasticity":
            theta[k] = {"stiffness": 15000.0, "damping": 100.0}[slot.name]
    rigid = build(arm, experiment, effects[1:])
    share = np.linalg.norm(assembly.torque(experiment, theta) - rigid.torque(experiment, theta[2:]))
    share /= np.linalg.norm(assembly.torque(experiment, theta))
    assert 1e-3 < share < 0.1
    found = errors(jacobian(assembly, experiment, theta), differences(assembly, experiment, theta))
    for slot, error in zip(assembly.slots, found, strict=True):
        limit = 2 * share if slot.effect == "payload_mass" else 1e-6
        assert error < limit, (slot.key, error, share)


def test_derivative_by_a_free_inertia_behind_a_flexible_joint(arm, experiment):
    """All inertia grown alike: the derivative says that the torque grows alike, and leaves out that the twist does."""
    base = base_parameters(arm[1])
    assembly = build(arm, experiment, placed(("joint_elasticity", "joint2")), base)
    n = len(base.columns)
    theta = np.concatenate([base.matrix @ arm[0].phi, [15000.0, 100.0]])
    more = theta + np.r_[1e-4 * theta[:n], 0.0, 0.0]
    wanted = (assembly.torque(experiment, more) - assembly.torque(experiment, theta)) / 1e-4
    found = jacobian(assembly, experiment, theta)[:, :, :n] @ theta[:n]
    twist = assembly.torque(experiment, theta) - assembly.evaluate(experiment, theta).load
    assert np.linalg.norm(found - wanted) < 1.05 * np.linalg.norm(twist)
    assert np.linalg.norm(twist) < 0.1 * np.linalg.norm(wanted)


def test_residual_is_measured_minus_modelled_in_the_band_with_its_derivatives(arm, experiment):
    base = base_parameters(arm[1])
    for chosen, effects in ((None, LINKS + MANY), (base, MANY), (base, MANY[:4])):
        assembly = build(arm, experiment, effects, chosen)
        for theta in (inside(assembly), 1.01 * inside(assembly)):  # twice: constant columns come from the store then
            residual, blocks = assembly.residual(experiment, theta)
            recorded = experiment.motion
            wanted = recorded.to_band(recorded.tau - assembly.torque(experiment, theta))
            np.testing.assert_allclose(residual, wanted, atol=1e-9)
            dense = np.zeros((*residual.shape, len(theta)))
            for block in blocks:
                for k, i in enumerate(block.index):
                    dense[:, block.channel, i] += block.values[:, k]
            np.testing.assert_allclose(dense, recorded.to_band(jacobian(assembly, experiment, theta)), atol=1e-8)


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
    assembly = Assembly(tree, effects, base, scales([recorded]), {})
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
