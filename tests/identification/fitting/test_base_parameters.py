"""Base parameters against textbook counts and closed forms, and against torques from Drake."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    MultibodyForces,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from scipy.spatial.transform import Rotation

from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.models.inertia import from_central
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Joint, Link, Tree

RIGHT = np.pi / 2
UP = (0, 0, 1)


def tree(*joints, gravity=(0.0, 0.0, -9.81), phi=None):
    """Joints as (kind, axis, parent, roll-pitch-yaw, translation)."""
    made = [
        Joint(
            f"joint{i + 1}",
            kind,
            np.asarray(axis, float) / np.linalg.norm(axis),
            parent,
            Rotation.from_euler("xyz", turn).as_matrix(),
            np.asarray(arm, float),
        )
        for i, (kind, axis, parent, turn, arm) in enumerate(joints)
    ]
    phi = np.zeros((len(made), 10)) if phi is None else np.reshape(phi, (-1, 10))
    links = [Link(f"link{i + 1}", row) for i, row in enumerate(phi)]
    return Tree("tree", tuple(made), tuple(links), np.asarray(gravity, float))


def chain(*turns_and_arms, gravity=(0.0, 0.0, -9.81)):
    """Revolute joints about z in series, from (roll-pitch-yaw, translation)."""
    joints = [("revolute", UP, i - 1, turn, arm) for i, (turn, arm) in enumerate(turns_and_arms)]
    return tree(*joints, gravity=gravity)


def puma(right=RIGHT):
    """Six axes like a PUMA 560's: vertical, two parallel horizontal ones, and a wrist."""
    return chain(
        ((0, 0, 0), (0, 0, 0.67)),
        ((-right, 0, 0), (0, 0.24, 0)),
        ((0, 0, 0), (0.43, 0, -0.09)),
        ((-right, 0, 0), (0.02, 0.43, 0)),
        ((right, 0, 0), (0, 0, 0)),
        ((-right, 0, 0), (0, 0, 0)),
    )


def random_tree(seed, n_joints):
    """Branching tree of skewed revolute and prismatic joints with physical links."""
    rng = np.random.default_rng(seed)
    joints = [
        (
            "prismatic" if rng.random() < 0.3 else "revolute",
            rng.normal(size=3),
            int(rng.integers(max(-1, i - 2), i)),
            rng.uniform(-3, 3, 3),
            rng.normal(size=3) * 0.4,
        )
        for i in range(n_joints)
    ]
    return tree(*joints, phi=[random_body(rng) for _ in joints])


def random_body(rng):
    second = rng.normal(size=(3, 3)) * 0.2
    second = second @ second.T + 0.01 * np.eye(3)
    return from_central(rng.uniform(0.5, 3), rng.normal(size=3) * 0.2, np.trace(second) * np.eye(3) - second)


def drake_torque(tree, phi, q, qd, qdd):
    """Torque (n, J) from Drake's inverse dynamics."""
    plant = MultibodyPlant(0.0)
    bodies = []
    for joint, own in zip(tree.joints, phi.reshape(-1, 10), strict=True):
        mass, com = own[0], own[1:4] / own[0]
        inertia = RotationalInertia(*own[[4, 7, 9, 5, 6, 8]])
        spatial = SpatialInertia.MakeFromCentralInertia(mass, com, inertia.ShiftToCenterOfMass(mass, com))
        body = plant.AddRigidBody(f"link_of_{joint.name}", spatial)
        parent = plant.world_body() if joint.parent < 0 else bodies[joint.parent]
        pose = RigidTransform(RotationMatrix(joint.rotation), joint.translation)
        frame = plant.AddFrame(FixedOffsetFrame(f"frame_of_{joint.name}", parent.body_frame(), pose))
        kind = RevoluteJoint if joint.kind == "revolute" else PrismaticJoint
        plant.AddJoint(kind(joint.name, frame, body.body_frame(), joint.axis))
        bodies.append(body)
    plant.mutable_gravity_field().set_gravity_vector(tree.gravity)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    order = [plant.GetJointByName(joint.name).velocity_start() for joint in tree.joints]
    tau = np.empty(q.shape)
    for row in range(len(q)):
        state = np.empty((3, len(order)))
        state[:, order] = q[row], qd[row], qdd[row]
        plant.SetPositions(context, state[0])
        plant.SetVelocities(context, state[1])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        tau[row] = plant.CalcInverseDynamics(context, state[2], forces)[order]
    return tau


def test_prismatic_joint_has_its_mass():
    base = base_parameters(RigidBody(tree(("prismatic", (1, 0, 0), -1, (0, 0, 0), (3, 0, 0)))))
    assert base.names == (("link1", "mass", "mass[link1]"),)
    assert base.units == ("kg",)
    np.testing.assert_array_equal(base.columns, [0])
    np.testing.assert_allclose(base.matrix, np.eye(1, 10), atol=1e-14)


@pytest.mark.parametrize(("axis", "gravity", "names"), [
    (UP, (0, -9.81, 0), ["mx", "my", "Izz"]),
    ((0, -1, 0), (0, 0, -9.81), ["mx", "mz", "Iyy"]),
    ((1, 0, 0), (0, 0, -9.81), ["my", "mz", "Ixx"]),
    (UP, (0, 0, -9.81), ["Izz"]),
    (UP, (0, 0, 0), ["Izz"]),
])  # fmt: skip
def test_revolute_joint_has_its_own_inertia_and_what_gravity_shows(axis, gravity, names):
    base = base_parameters(RigidBody(tree(("revolute", axis, -1, (0, 0, 0), (0, 0, 5)), gravity=gravity)))
    assert [name for _, name, _ in base.names] == names
    assert [text for _, _, text in base.names] == [f"{name}[link1]" for name in names]
    assert base.units == tuple("kg*m^2" if name[0] == "I" else "kg*m" for name in names)


def test_skewed_revolute_axis_sums_inertia_about_itself():
    axis = np.array([2.0, -1.0, 2.0]) / 3
    base = base_parameters(RigidBody(tree(("revolute", axis, -1, (0, 0, 0), (0, 0, 0)))))
    x, y, z = axis
    about_axis = np.array([x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z])
    assert [name for _, name, _ in base.names] == ["mx", "my", "Ixx"]
    np.testing.assert_allclose(base.matrix[2], [0, 0, 0, 0, *(about_axis / x**2)], atol=1e-12)


def test_planar_arm_is_the_textbooks():
    base = base_parameters(RigidBody(chain(((0, 0, 0), (5, 3, 2)), ((0, 0, 0), (0.5, 0, 0)), gravity=(0, -9.81, 0))))
    assert base.names == (
        ("link1", "mx", "mx[link1] + 0.5*mass[link2]"),
        ("link1", "my", "my[link1]"),
        ("link1", "Izz", "Izz[link1] + 0.25*mass[link2]"),
        ("link2", "mx", "mx[link2]"),
        ("link2", "my", "my[link2]"),
        ("link2", "Izz", "Izz[link2]"),
    )
    phi1, phi2 = np.random.default_rng(1).normal(size=(2, 10))
    expected = [phi1[1] + 0.5 * phi2[0], phi1[2], phi1[9] + 0.25 * phi2[0], phi2[1], phi2[2], phi2[9]]
    np.testing.assert_allclose(base.matrix @ np.concatenate([phi1, phi2]), expected, rtol=1e-11)


def test_signs_and_whole_numbers_are_written_plainly():
    base = base_parameters(RigidBody(puma()))
    said = {(link, name): text for link, name, text in base.names}
    assert said["link6", "Ixx"] == "Ixx[link6] - Iyy[link6]"
    assert said["link5", "my"] == "my[link5] + mz[link6]"
    assert said["link4", "Izz"] == "Izz[link4] + Iyy[link5]"


SKEWED = [((0.3, 0.5 * i, 0.2), (0.3, -0.2, 0.1 * i)) for i in range(1, 7)]
HORIZONTAL = [((0, 0, 0), (0.4, 0, 0))] * 3


@pytest.mark.parametrize(("arm", "count"), [
    (puma(), 36),
    (puma(1.5708), 36),
    (chain(*SKEWED), 7 * 6 - 4),
    (chain(*SKEWED, gravity=(0, 0, 0)), 7 * 6 - 4 - 2),
    (chain(*HORIZONTAL), 7 * 3 - 4 * 3 - 2),
    (chain(*HORIZONTAL, gravity=(0, -9.81, 0)), 7 * 3 - 4 * 3),
    (chain(((RIGHT, 0, 0), (0, 0, 0)), ((1.5708 - RIGHT, 0, 0), (1e-1, 0, 0))), 7 * 2 - 4 * 2),
])  # fmt: skip
def test_count_of_revolute_arms(arm, count):
    """7 n - 4 b, b parallel axes first, less 2 where gravity is along them (Mayeda, Yoshida, Osuka 1990)."""
    assert len(base_parameters(RigidBody(arm)).columns) == count


@pytest.mark.parametrize(("seed", "n_joints"), [(0, 3), (3, 4), (5, 6)])
def test_drake_sees_these_combinations_and_no_others(seed, n_joints):
    arm = random_tree(seed, n_joints)
    base = base_parameters(RigidBody(arm))
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.normal(size=(3, 20, n_joints))
    phi = arm.phi
    tau = drake_torque(arm, phi, q, qd, qdd)
    # torque is linear in phi: differences are exact, and small ones keep the links physical
    size = 1e-4
    responses = [drake_torque(arm, phi + size * unit, q, qd, qdd) - tau for unit in np.eye(10 * n_joints)]
    singular = np.linalg.svd(np.array([r.ravel() for r in responses]) / size, compute_uv=False)
    assert len(base.columns) == np.count_nonzero(singular > 1e-7 * singular[0])
    _, _, rows = np.linalg.svd(base.matrix)
    unseen = rows[len(base.columns) :].T @ rng.normal(size=10 * n_joints - len(base.columns))
    seen = base.matrix.T @ rng.normal(size=len(base.columns))
    for direction, shows in ((unseen, False), (seen, True)):
        other = phi + 1e-3 * direction / np.abs(direction).max()
        assert np.abs(other - phi).max() > 9e-4
        assert np.allclose(base.matrix @ other, base.matrix @ phi, rtol=0, atol=1e-12) != shows
        assert (np.abs(drake_torque(arm, other, q, qd, qdd) - tau).max() > 1e-9) == shows


@pytest.mark.parametrize("seed", range(3))
def test_torque_is_the_kept_columns_times_beta(seed):
    arm = random_tree(seed, 6)
    base = base_parameters(RigidBody(arm), seed=seed)
    q, qd, qdd = np.random.default_rng(seed).normal(size=(3, 30, 6))
    columns = RigidBody(arm).regressor(q, qd, qdd)[:, :, base.columns]
    tau = drake_torque(arm, arm.phi, q, qd, qdd)
    np.testing.assert_allclose(columns @ (base.matrix @ arm.phi), tau, atol=1e-10 * np.abs(tau).max())


def test_combinations_do_not_depend_on_the_motions():
    body = RigidBody(puma())
    first, second = base_parameters(body, seed=0), base_parameters(body, seed=1)
    assert first.names == second.names
    np.testing.assert_allclose(first.matrix, second.matrix, atol=1e-11)


def test_size_of_the_arm_does_not_matter():
    def arm(scale):
        joints = [(turn, np.multiply(arm, scale)) for turn, arm in SKEWED]
        return base_parameters(RigidBody(chain(*joints)))

    small, large = arm(1e-3), arm(1e2)
    np.testing.assert_array_equal(small.columns, large.columns)
