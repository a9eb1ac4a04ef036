"""The suspension rig: its torque against Drake's, its maps against work done, and what a model file makes of it."""

import functools
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from bench.arm import random_arm
from bench.drake_rig import rig_torque
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.models.effects import get_effect
from snarelab.models.inertia import to_central
from snarelab.models.model import PlacedEffect, places
from snarelab.models.rig.kinematics import slides, sling_map
from snarelab.models.rig.points import point_motion
from snarelab.models.rig.rig import Rig, Sling, built_in_rig, hang_unit_loads
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf
from snarelab.recordings.condition import Motion

PERIOD = 0.01


def motion(tree, n=400, seed=0):
    """Smooth random motion of every joint with its exact derivatives; joints with horizontal axes move less."""
    rng = np.random.default_rng(seed)
    t = np.asarray(PERIOD * np.arange(n), np.float64)
    q, qd, qdd = np.zeros((3, n, tree.n_joints))
    for j, joint in enumerate(tree.joints):
        size = 0.15 if joint.kind == "prismatic" else 0.8 if abs(joint.axis[2]) > 0.5 else 0.2
        for w in rng.uniform(0.3, 2.0, 3):
            phase = rng.uniform(0, 2 * np.pi)
            q[:, j] += size * np.sin(w * t + phase)
            qd[:, j] += size * w * np.cos(w * t + phase)
            qdd[:, j] -= size * w**2 * np.sin(w * t + phase)
    names = tuple(j.name for j in tree.joints)
    whole = (slice(0, n),)
    return Motion(
        "run.csv",
        names,
        PERIOD,
        50.0,
        t,
        q,
        qd,
        qdd,
        np.ones_like(q),
        np.full_like(q, 20.0),
        whole,
        1,
        (),
        np.zeros((3, q.shape[1])),
    )


def makkar(parameters, v):
    a, b, r, c, d, e = parameters
    return a * (np.tanh(v / b) - np.tanh(v / (r * b))) + c * np.tanh(v / d) + e * v


SLIDE = (1, 0.01, 2, 5, 0.03, 1), (40, 0.1, 20, 50, 0.1, 30)
PULL = (-0.1, 0), (0.1, 200)


def loaded(rig, seed):
    """Slide friction at every slide and a tension error on every sling that can turn a joint, drawn at random."""
    rng = np.random.default_rng(seed)
    names = ("slide_friction", "sling_tension_error")
    effects = [PlacedEffect(get_effect(name), at) for name in names for at in places(get_effect(name), rig)]
    values = {}
    for p in effects:
        low, high = SLIDE if p.effect.at == "slide" else PULL
        drawn = rng.uniform(low, high)
        values |= {f"{p.key}.{x.name}": v for x, v in zip(p.effect.parameters, drawn, strict=True)}
    return effects, values


def drake_torque(rig, m, values, under_gravity):
    names = [x.name for x in get_effect("slide_friction").parameters]
    numbers = {j: [values[f"slide_friction.{j}.{name}"] for name in names] for j in slides(rig)}
    friction = {j: functools.partial(makkar, p) for j, p in numbers.items()}

    def pull(sling, velocity):
        key = f"sling_tension_error.{sling}"
        return values.get(f"{key}.share", 0) * tension[sling] - values.get(f"{key}.lag_loss", 0) * velocity[2]

    tension = {s.name: s.tension for s in rig.slings}
    return rig_torque(rig, (m.q, m.qd, m.qdd), friction, pull, under_gravity=under_gravity)


def modelled(rig, m, effects, values):
    experiment = Experiment(m, RigidBody(rig))
    assembly = TorqueModel(rig, effects, None, scales([experiment]), values)
    return assembly.torque(experiment, np.array([values[s.key] for s in assembly.slots]))


def test_the_built_in_rig_agrees_with_drake_under_gravity_and_full_tensions():
    rig, m = built_in_rig(), motion(built_in_rig(), 100)
    effects, values = loaded(rig, 1)
    wanted = drake_torque(rig, m, values, True)
    found = modelled(rig, m, effects, values)
    assert np.abs(wanted).max(axis=0).min() > 1.0
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_random_rig_agrees_with_drake(tmp_path, seed):
    rig, _ = random_rig(tmp_path, seed)
    m = motion(rig, 60, seed)
    effects, values = loaded(rig, seed)
    wanted = drake_torque(rig, m, values, False)
    np.testing.assert_allclose(modelled(rig, m, effects, values), wanted, rtol=0, atol=1e-9)


def random_rig(tmp_path, seed):
    """A random arm of five joints, some sliding, hung at random points with random contacts."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 5, 0.3)
    (tmp_path / "arm.urdf").write_text(arm.urdf())
    tree = load_urdf(tmp_path / "arm.urdf", (0.0, 0.0, -9.81))
    slings = tuple(
        Sling(f"s{i}", i % 5, rng.normal(size=3), rng.uniform(1, 50), rng.uniform(0, 9), rng.normal(size=(i % 3, 3)))
        for i in range(8)
    )
    return Rig(tree.name, tree.joints, tree.links, tree.gravity, slings), arm


def test_joint_1_does_not_feel_any_vertical_force():
    rig, m = built_in_rig(), motion(built_in_rig(), 60)
    for name in ("sling_tension_error", "link_torsion", "link_bending", "suspension_stiffness"):
        effect = get_effect(name)
        for at in places(effect, rig):
            experiment = Experiment(m, RigidBody(rig))
            plain = TorqueModel(rig, [], None, scales([experiment]), {})
            numbers = {f"{name}.{at}.{p.name}": 3.0 for p in effect.parameters}
            with_it = TorqueModel(rig, [PlacedEffect(effect, at)], None, scales([experiment]), numbers)
            change = with_it.torque(experiment, with_it.start) - plain.torque(experiment, plain.start)
            assert np.all(change[:, 0] == 0), at
            assert not any(b.channel == 0 for b in with_it.evaluate(experiment, with_it.start).blocks)
            assert np.abs(change[:, 1]).max() > 1e-3, at


def test_in_balance_the_arm_moves_as_without_gravity():
    rig, m = built_in_rig(), motion(built_in_rig())
    wanted = RigidBody(rig).torque(m.q, m.qd, m.qdd, gravity=np.zeros(3))
    np.testing.assert_allclose(modelled(rig, m, [], {}), wanted, rtol=0, atol=1e-9)
    experiment = Experiment(m, RigidBody(rig))
    free = TorqueModel(rig, [], base_parameters(experiment.body), scales([experiment]), {})
    np.testing.assert_allclose(free.torque(experiment, free.start), wanted, rtol=0, atol=1e-6)


def test_what_the_slings_do_not_know_of_shows_under_gravity():
    """A payload is lifted by no sling: the torque is that of the payload's own weight and inertia."""
    rig, m = built_in_rig(), motion(built_in_rig())
    payload = PlacedEffect(get_effect("payload_mass"), "link7")
    values = {"payload_mass.link7.mass": 5.0} | {f"payload_mass.link7.{a}": 0.1 for a in "xyz"}
    change = modelled(rig, m, [payload], values) - modelled(rig, m, [], {})
    held = np.array(to_central(rig.links[6].phi)[1]) + 0.1
    at = point_motion(rig, 6, held, m.q, m.qd)
    ahead, behind = (point_motion(rig, 6, held, m.q + s * 1e-5 * m.qd, m.qd + s * 1e-5 * m.qdd) for s in (1, -1))
    acceleration = (ahead.velocity - behind.velocity) / 2e-5
    wanted = np.einsum("nik,ni->nk", at.jacobian[:, :3], 5.0 * (acceleration + np.array([0, 0, 9.81])))
    np.testing.assert_allclose(change, wanted, rtol=0, atol=1e-5)


@pytest.mark.parametrize(("name", "link"), [("link_torsion", 2), ("link_torsion", 3), ("link_bending", 2)])
def test_a_boom_and_its_slings_share_a_misfit(name, link):
    """The far end of the boom is turned by a small angle, by hand: the angle at which boom and slings have the least
    energy, and the drive torques that the slings' change of pull does work against."""
    rig, m = built_in_rig(), motion(built_in_rig(), 12)
    stiffness, suspension, misfit = 4e4, 900.0, 1e-3
    place = rig.links[link].name
    p = {f"{name}.{place}.torque": stiffness * misfit, f"{name}.{place}.radius": np.sqrt(stiffness / suspension)}
    change = modelled(rig, m, [PlacedEffect(get_effect(name), place)], p) - modelled(rig, m, [], {})
    end, beyond = rig.joints[link + 1].translation, rig.outboard(link)

    def heights(q, angle):
        """Of the slings beyond, with everything beyond the boom turned about an axis through its far end."""
        far = point_motion(rig, link, end, q[None], q[None])
        axis = far.rotation[0] @ end / np.linalg.norm(end)
        if name == "link_bending":
            axis = np.cross([0, 0, 1], axis) / np.linalg.norm(np.cross([0, 0, 1], axis))
        turn = Rotation.from_rotvec(angle * axis)
        points = [point_motion(rig, s.link, s.point, q[None], q[None]).position[0] for s in beyond]
        return np.array([turn.apply(x - far.position[0])[2] + far.position[0, 2] for x in points])

    for q, found in zip(m.q, change, strict=True):
        level = heights(q, 0.0)

        def energy(angle, q=q, level=level):
            return stiffness * (angle - misfit) ** 2 + suspension * np.sum((heights(q, angle) - level) ** 2)

        least: Any = minimize_scalar(energy, bounds=(-misfit, 2 * misfit), method="bounded", options={"xatol": 1e-12})
        pull = -suspension * (heights(q, least.x) - level)
        for j in range(7):
            step = 1e-5 * np.eye(7)[j]
            rise = (heights(q + step, 0.0) - heights(q - step, 0.0)) / 2e-5
            assert found[j] == pytest.approx(-pull @ rise, abs=2e-3 * np.abs(change).max())


def test_stiff_slings_store_the_energy_of_springs():
    """The drives supply the gradient of half the stiffness times the sum of squared rises, by differences."""
    rig, m, stiffness = built_in_rig(), motion(built_in_rig(), 12), 500.0
    p = {"suspension_stiffness.slings.stiffness": stiffness}
    placed = [PlacedEffect(get_effect("suspension_stiffness"), "slings")]
    change = modelled(rig, m, placed, p) - modelled(rig, m, [], {})

    def heights(q):
        return np.array([point_motion(rig, s.link, s.point, q[None], q[None]).position[0, 2] for s in rig.slings])

    level = heights(np.zeros(7))
    for q, found in zip(m.q, change, strict=True):
        for j, step in enumerate(1e-5 * np.eye(7)):
            ahead, behind = (0.5 * stiffness * np.sum((heights(q + s * step) - level) ** 2) for s in (1, -1))
            assert found[j] == pytest.approx((ahead - behind) / 2e-5, abs=1e-6 * np.abs(change).max())


def test_maps_do_the_work_of_the_forces_they_stand_for():
    """Virtual work: a wrench through a map is worth as much on the joints as on the point that it moves."""
    rig, m = built_in_rig(), motion(built_in_rig(), 30)
    sling, wrench, step = rig.slings[8], np.array([3.0, -2.0, 7.0, 0, 0, 0]), 1e-6
    here = sling_map(rig, sling, m.q)
    for j in range(7):
        move = np.zeros(7)
        move[j] = step
        ahead, behind = (point_motion(rig, sling.link, sling.point, m.q + s * move, m.qd) for s in (1, -1))
        moved = (ahead.position - behind.position) / (2 * step)
        np.testing.assert_allclose(-here[:, j] @ wrench, moved @ wrench[:3], atol=1e-7)


def test_force_balance_of_a_hang_unit():
    loads = hang_unit_loads(joint=400.0, rod=15.0, plate=25.0, bar=40.0)
    assert loads.bar == 400 + 2 * 15 + 25 + 20
    assert loads.plate == 400 + 2 * 15 + 25
    assert (loads.rods, loads.joint) == (430, 400)


def test_the_built_in_slings_carry_every_link_without_a_moment():
    rig = built_in_rig()
    assert len(rig.slings) == 10
    assert [j.axis.tolist() for j in rig.joints] == [[0, 0, 1] if a == "z" else [1, 0, 0] for a in "zxzzzxz"]
    for i, link in enumerate(rig.links):
        mass, com, _ = to_central(link.phi)
        own = [s for s in rig.slings if s.link == i]
        assert sum(s.weight for s in own) == pytest.approx(mass * 9.81)
        np.testing.assert_allclose(sum(s.weight * s.point for s in own), mass * 9.81 * com, atol=1e-9)
