"""Inertia, Jacobians and momentum of an arm on a floating base: closed form, Drake, finite differences, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from snarelab.errors import InputError
from snarelab.models.floating import dynamics
from snarelab.models.floating.arm import FloatingArm, load_arm
from snarelab.models.floating.ets_vii import ets_vii
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.plant import FloatingPlant
from snarelab.models.inertia import from_central, is_physical, nearest_physical, to_central
from snarelab.models.tree import Joint, Link, Tree

Z = np.array([0.0, 0.0, 1.0])
pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture(scope="module")
def arm():
    return ets_vii()


@pytest.fixture(scope="module")
def motion(rng):
    return rng.uniform(-2, 2, (20, 6)), rng.uniform(-1, 1, (20, 6)), rng.uniform(-1, 1, (20, 6))


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(4)


class PlanarTwoLink:
    """Closed form of a base and two links in a plane, by barycentric vectors (Papadopoulos, Dubowsky 1991).

    With the total centre of mass at rest in the origin, each point is a constant combination of the unit vectors
    along base, link 1 and link 2; from these follow kinetic energy and angular momentum.
    """

    mass = np.array([50.0, 6.0, 4.0])
    moment = np.array([8.0, 0.7, 0.3])
    mount, length, centre = 0.8, np.array([1.2, 0.9]), np.array([0.5, 0.35])

    def __init__(self) -> None:
        b, (l1, l2), (a1, a2) = self.mount, self.length, self.centre
        # bodies' centres and the tip from the base's centre, in (u0, u1, u2)
        reach = np.array([[0, 0, 0], [b, a1, 0], [b, l1, a2], [b, l1, l2]])
        self.points = reach - self.mass @ reach[:3] / self.mass.sum()

    def arm(self) -> FloatingArm:
        """The same as a FloatingArm; what turns about z is all that shows."""
        eye, planes = np.eye(3), [np.array([x, 0.0, 0.0]) for x in (self.mount, self.length[0])]
        joints = tuple(Joint(f"j{i}", "revolute", Z, i - 1, eye, planes[i]) for i in range(2))
        bodies = [
            from_central(m, [c, 0, 0], np.diag([0.6 * i, 0.7 * i, i]))
            for m, c, i in zip(self.mass, [0.0, *self.centre], self.moment, strict=True)
        ]
        links = tuple(Link(f"l{i}", phi) for i, phi in enumerate(bodies[1:]))
        tree = Tree("planar", joints, links, np.zeros(3))
        return FloatingArm(tree, bodies[0], 1, tip_translation=np.array([self.length[1], 0.0, 0.0]))

    def angles(self, q):
        return np.array([0.0, q[0], q[0] + q[1]])

    def turning(self, q):
        """Rates of the three absolute angles per joint rate (3, 2), at zero angular momentum; and A of the energy."""
        difference = np.subtract.outer(self.angles(q), self.angles(q))
        energy = np.diag(self.moment) + (self.points[:3].T * self.mass) @ self.points[:3] * np.cos(difference)
        by_base, by_joints = np.ones(3), np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
        base = -(by_base @ energy @ by_joints) / (by_base @ energy @ by_base)
        return by_joints + np.outer(by_base, base), energy

    def jacobian(self, q):
        """(vx, vy, wz) of the tip per joint rate (3, 2)."""
        turning, _ = self.turning(q)
        angles = self.angles(q)
        normals = np.array([-np.sin(angles), np.cos(angles)])
        return np.vstack([(normals * self.points[3]) @ turning, turning[2]])

    def inertia(self, q):
        turning, energy = self.turning(q)
        return turning.T @ energy @ turning


def test_planar_two_link_has_its_closed_form(rng):
    planar = PlanarTwoLink()
    q = rng.uniform(-3, 3, (10, 2))
    jacobians = dynamics.generalized_jacobian(planar.arm(), q)
    inertias = dynamics.generalized_inertia(planar.arm(), q)
    for k in range(10):
        np.testing.assert_allclose(jacobians[k][[0, 1, 5]], planar.jacobian(q[k]), atol=1e-14)
        np.testing.assert_allclose(inertias[k], planar.inertia(q[k]), rtol=1e-13)
    np.testing.assert_allclose(jacobians[:, [2, 3, 4]], 0.0, atol=1e-15)


def test_generalized_jacobian_is_the_simulated_tip_velocity(arm):
    """Steps of 10 ms, so that the base moves as momentum wants to rounding; the tip's velocity is Drake's own."""
    gains = np.diag(dynamics.generalized_inertia(arm, np.zeros((1, 6)))[0])
    plant = FloatingPlant(arm, gains, 2 * gains)
    run = plant.run(np.arange(1, 7) / 10, 5.0, longest=0.01)
    expected = np.einsum("nij,nj->ni", dynamics.generalized_jacobian(arm, run.q), run.qd)
    context, body = plant.plant.CreateDefaultContext(), plant.plant.GetBodyByName("link6")
    worst = 0.0
    for k in range(0, len(run.time), 10):
        positions = np.concatenate([run.quaternion[k], run.position[k], run.q[k]])
        rates = np.concatenate([run.spin[k], run.velocity[k], run.qd[k]])
        plant.plant.SetPositionsAndVelocities(context, np.concatenate([positions, rates]))
        twist = body.EvalSpatialVelocityInWorld(context)
        lever = body.EvalPoseInWorld(context).rotation().matrix() @ arm.tip_translation
        velocity = twist.translational() + np.cross(twist.rotational(), lever)
        parts = [dynamics.in_world(run.quaternion[[k]], v)[0] for v in (expected[[k], :3], expected[[k], 3:])]
        worst = max(worst, np.abs(np.concatenate(parts) - np.concatenate([velocity, twist.rotational()])).max())
    assert worst <= 1e-12
    assert np.abs(expected).max() > 0.05  # [m/s, rad/s]: what the bar is to be compared with


def test_generalized_jacobian_against_finite_differences(arm, motion):
    """A joint step at zero momentum moves the base too; central differences of the tip's pose in the world."""
    q, step = motion[0][:5], 1e-5
    jacobian = dynamics.generalized_jacobian(arm, q)
    for j in range(6):
        qd = np.tile(np.eye(6)[j], (5, 1))
        twist = dynamics.base_twist(arm, q, qd)
        pose = {sign: dynamics.tip_pose(arm, q + sign * step * qd) for sign in (-1, 1)}
        for k in range(5):
            there = {}
            for sign, (rotation, translation) in pose.items():
                v, w = sign * step * twist[k, :3], sign * step * twist[k, 3:]
                generator = np.zeros((4, 4))
                generator[:3, :3], generator[:3, 3] = np.cross(np.eye(3), w), v
                at = np.eye(4)
                at[:3, :3], at[:3, 3] = rotation[k], translation[k]
                there[sign] = expm(generator) @ at
            change = (there[1] - there[-1]) / (2 * step)
            turning = change[:3, :3] @ dynamics.tip_pose(arm, q[[k]]).rotation[0].T
            found = np.concatenate([change[:3, 3], [turning[2, 1], turning[0, 2], turning[1, 0]]])
            np.testing.assert_allclose(found, jacobian[k, :, j], atol=1e-8)


def test_inertia_and_momentum_are_drakes(arm, motion):
    """Drake's momentum about the base frame's origin, and its mass matrix in its own coordinates (w, v; world)."""
    q, twist, qd = motion
    plant = FloatingPlant(arm, np.zeros(6), np.zeros(6)).plant
    context, whole = plant.CreateDefaultContext(), dynamics.inertia(arm, q)
    for k in range(len(q)):
        plant.SetPositions(context, np.concatenate([[1, 0, 0, 0, 0, 0, 0], q[k]]))
        plant.SetVelocities(context, np.concatenate([twist[k, 3:], twist[k, :3], qd[k]]))
        order = [3, 4, 5, 0, 1, 2, *range(6, 12)]
        matrix = plant.CalcMassMatrix(context)[np.ix_(order, order)]
        np.testing.assert_allclose(whole[k], matrix, atol=1e-10 * np.abs(matrix).max())
        theirs = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3))
        ours = dynamics.momentum(arm, q[[k]], twist[[k]], qd[[k]])[0]
        np.testing.assert_allclose(ours, [*theirs.translational(), *theirs.rotational()], rtol=1e-12, atol=1e-9)
    blocks = dynamics.base_inertia(arm, q), dynamics.coupling_inertia(arm, q), dynamics.joint_inertia(arm, q)
    for block, part in zip(blocks, (whole[:, :6, :6], whole[:, :6, 6:], whole[:, 6:, 6:]), strict=True):
        np.testing.assert_array_equal(block, part)
    energy = 0.5 * np.einsum("ni,nij,nj->n", np.hstack([twist, qd]), whole, np.hstack([twist, qd]))
    np.testing.assert_allclose(dynamics.kinetic_energy(arm, q, twist, qd), energy, rtol=1e-13)


def test_inverse_dynamics_is_drakes(arm, motion):
    """Drake's accelerations of a floating base are those of its origin and its angular ones, in the world."""
    q, twist, qd = motion
    rng = np.random.default_rng(8)
    acceleration, qdd = rng.normal(size=(20, 6)), rng.normal(size=(20, 6))
    ours = dynamics.inverse_dynamics(arm, q, twist, qd, acceleration, qdd)
    plant = FloatingPlant(arm, np.zeros(6), np.zeros(6)).plant
    context, none = plant.CreateDefaultContext(), MultibodyForces(plant)
    for k in range(20):
        plant.SetPositions(context, np.concatenate([[1, 0, 0, 0, 0, 0, 0], q[k]]))
        plant.SetVelocities(context, np.concatenate([twist[k, 3:], twist[k, :3], qd[k]]))
        rates = np.concatenate([acceleration[k, 3:], acceleration[k, :3], qdd[k]])
        theirs = plant.CalcInverseDynamics(context, rates, none)
        np.testing.assert_allclose(ours[k], theirs[[3, 4, 5, 0, 1, 2, *range(6, 12)]], atol=1e-9)


def test_inverse_dynamics_finds_the_force_on_a_simulated_base(arm):
    """From the motion alone, with accelerations by differences: a force at the tip shows in the base's six rows."""
    simulation = FloatingMotion(arm, tolerance=1e-12)
    inputs, step = np.zeros(12), 1e-3
    inputs[:6] = 3.0, -2.0, 4.0, 0.5, 1.0, -0.7
    states = [simulation.start(np.full(6, 0.3))]
    for k in range(4):  # the middle one of five, by central differences of fourth order
        states.append(simulation.advance(k * step, states[-1], (k + 1) * step, step, inputs, servo=False).state)
    seen, (q, qd) = simulation.observe(np.array(states)), simulation.joints(np.array(states))
    weights = np.array([1, -8, 0, 8, -1]) / (12 * step)
    back = Rotation.from_quat(seen.base_quaternion[2], scalar_first=True).inv()

    def own(pair):
        return np.concatenate([back.apply(pair[:3]), back.apply(pair[3:])])[None]

    found = dynamics.inverse_dynamics(
        arm, q[[2]], own(seen.base_twist[2]), qd[[2]], own(weights @ seen.base_twist), (weights @ qd)[None]
    )[0]
    lever = seen.tip_position[2] - seen.base_position[2]
    expected = own(np.concatenate([inputs[:3], inputs[3:6] + np.cross(lever, inputs[:3])]))[0]
    np.testing.assert_allclose(found[:6], expected, atol=1e-6)
    pull = dynamics.tip_jacobians(arm, q[[2]])[1][0].T @ own(inputs[:6])[0]
    np.testing.assert_allclose(found[6:], pull, atol=1e-6)


def test_base_motion_that_a_momentum_asks_for(arm, motion):
    q, twist, qd = motion
    total = dynamics.momentum(arm, q, twist, qd)
    np.testing.assert_allclose(dynamics.base_twist(arm, q, qd, total), twist, atol=1e-12)
    np.testing.assert_allclose(dynamics.momentum(arm, q, dynamics.base_twist(arm, q, qd), qd), 0.0, atol=1e-11)


def test_joint_rates_give_the_tip_twist_asked_for(arm, motion):
    q, wanted, _ = motion
    rates = dynamics.joint_rates(arm, q, wanted)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", dynamics.generalized_jacobian(arm, q), rates), wanted, atol=1e-9)


def test_a_fixed_base_is_the_limit_of_a_heavy_one(arm, motion):
    q, _, qd = motion
    still = replace(arm, floating=False)
    heavy = replace(arm, base=1e9 * arm.base)
    for function in (dynamics.generalized_inertia, dynamics.generalized_jacobian):
        np.testing.assert_allclose(function(still, q), function(heavy, q), atol=1e-4)
    assert not dynamics.base_twist(still, q, qd).any()


def test_published_inertias_are_kept_and_projected_on_demand(arm):
    assert arm.unphysical() == ("link2", "link3", "link5")
    assert not ets_vii(projected=True).unphysical()
    assert arm.base[0] + arm.tree.phi[::10].sum() == pytest.approx(2692.38, abs=1e-9)
    for before, after in zip(arm.tree.links, ets_vii(projected=True).tree.links, strict=True):
        kept = is_physical(before.phi)
        assert np.array_equal(before.phi, after.phi) == kept
        np.testing.assert_allclose(after.phi, nearest_physical(*to_central(before.phi)), rtol=1e-9, atol=1e-12)


URDF = """<robot name="two">
<link name="hull"><inertial><mass value="100"/>
<inertia ixx="9" ixy="0" ixz="0" iyy="8" iyz="0" izz="7"/></inertial></link>
<link name="panel"><inertial><origin xyz="0 1 0"/><mass value="10"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="rod"><inertial><mass value="5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<link name="hand"/>
<joint name="hinge" type="fixed"><parent link="hull"/><child link="panel"/><origin xyz="0 2 0"/></joint>
<joint name="elbow" type="revolute"><parent link="panel"/><child link="rod"/><origin xyz="0 0 1"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="wrist" type="fixed"><parent link="rod"/><child link="hand"/><origin xyz="0 0 0.5" rpy="0 0 1"/></joint>
</robot>"""


def test_any_urdf_floats_on_its_root_link(tmp_path):
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    arm = load_arm(path, tip="hand")
    mass, com, _ = to_central(arm.base)
    assert mass == pytest.approx(110)
    np.testing.assert_allclose(com, [0, 30 / 110, 0])
    rotation, translation = dynamics.tip_pose(arm, [[np.pi / 2]])
    np.testing.assert_allclose(translation[0], [0, 1.5, 1], atol=1e-15)
    np.testing.assert_allclose(rotation[0] @ Z, [0, -1, 0], atol=1e-15)
    with pytest.raises(InputError, match="tip is 'panel'; name a link that a joint moves: rod, hand"):
        load_arm(path, tip="panel")
    with pytest.raises(InputError, match="floating base with gravity"):
        load_arm(path, tip="hand", gravity=(0, 0, -9.81))
    assert load_arm(path, tip="hand", floating=False, gravity=(0, 0, -9.81)).tree.gravity[2] == -9.81


def test_bad_input_is_named(arm):
    with pytest.raises(InputError, match=r"q has shape \(1, 5\); give \(n_samples, 6\): one column per joint"):
        dynamics.inertia(arm, np.zeros((1, 5)))
    with pytest.raises(InputError, match=r"twist has shape \(2, 6\); give \(1, 6\)"):
        dynamics.momentum(arm, np.zeros((1, 6)), np.zeros((2, 6)), np.zeros((1, 6)))
    with pytest.raises(InputError, match="q is nan in row 1, column 3"):
        dynamics.tip_pose(arm, np.where(np.arange(12).reshape(2, 6) == 9, np.nan, 0.0))
    row = np.array([[0.3, 0.4, 0.0, 0.2, 0.5, 0.1]])

    def determinant(angle):
        return float(np.linalg.det(dynamics.generalized_jacobian(arm, row + angle * np.eye(6)[2])[0]))

    angles = np.linspace(-3, 3, 61)
    signs = np.sign([determinant(angle) for angle in angles])
    k = int(np.flatnonzero(np.diff(signs))[0])
    row[0, 2] = brentq(determinant, angles[k], angles[k + 1], xtol=1e-15)
    with pytest.raises(InputError, match="is singular in row 0 at q ="):
        dynamics.joint_rates(arm, row, np.ones((1, 6)))
    with pytest.raises(InputError, match="2 joints cannot give the tip any twist"):
        dynamics.joint_rates(PlanarTwoLink().arm(), [[1.0, 1.0]], np.ones((1, 6)))
    with pytest.raises(InputError, match="link 'link2' has an inertia that no body can have"):
        replace(arm, as_published=False)
    with pytest.raises(InputError, match="a mass of 0 kg"):
        replace(arm, base=np.zeros(10))
    with pytest.raises(InputError, match=r"target is \[1.0\]; give 6 finite numbers"):
        FloatingPlant(arm, np.ones(6), np.ones(6)).run([1.0], 1.0)
    with pytest.raises(InputError, match=r"duration is 0\.0 s"):
        FloatingPlant(arm, np.ones(6), np.ones(6)).run(np.ones(6), 0.0)
