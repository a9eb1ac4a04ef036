"""Virtual joints at a link's far end: closed forms of an L-shaped arm, MuJoCo with hinges there, and what is a beam."""

# pyright: reportAttributeAccessIssue=false

import mujoco
import numpy as np
import pytest

from bench.arm import Arm, length_axes, random_arm
from snarelab.models.beam import beam_terms, beams, cut
from snarelab.models.beam import length_axes as own_axes
from snarelab.models.floating.arm import load_arm
from snarelab.models.floating.tree import floating_tree
from snarelab.models.inertia import from_central
from snarelab.models.rig.rig import built_in_rig
from snarelab.models.rigid_body import RigidBody
from snarelab.models.tree import Follower, Joint, Link, Tree
from snarelab.models.urdf import load_urdf

pytestmark = pytest.mark.usefixtures("own_cache")
MASS, LENGTH, SIDE, G = 3.0, 1.4, 0.5, 9.81
LIFT = np.array([0.0, -1.0, 0.0])
"""Axis about which a positive angle raises a link that lies along x."""


def bent_arm(side, gravity=G):
    """A turntable, a lifting link along x, and a point mass on an arm of its own from the link's far end on."""
    one, no = np.eye(3), np.zeros(3)
    joints = (
        Joint("turn", "revolute", one[2], -1, one, no),
        Joint("lift", "revolute", LIFT, 0, one, no),
        Joint("elbow", "revolute", LIFT, 1, one, np.array([LENGTH, 0.0, 0.0])),
    )
    tip = from_central(MASS, side, np.zeros((3, 3)))
    links = (Link("table", np.zeros(10)), Link("beam", np.zeros(10)), Link("hand", tip))
    return Tree("bent", joints, links, np.array([0.0, 0.0, -gravity]))


def about(tree, axis):
    """Terms of the link about the virtual axis nearest to one in its frame, with that axis' sign, one instant."""
    signs = own_axes(np.array([LENGTH, 0.0, 0.0])).T @ axis
    k = int(np.argmax(np.abs(signs)))

    def terms(q, qd=(0.0, 0.0, 0.0), qdd=(0.0, 0.0, 0.0)):
        found = beam_terms(tree, 1, *(np.array([x]) for x in (q, qd, qdd)))
        moment, inertia, *by = (x[0] for x in found)
        return moment[k] * signs[k], inertia[k, k], *(x[:, k] * signs[k] for x in by)

    return terms


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.1])
def test_torsion_of_an_l_shaped_arm_is_the_closed_form(angle):
    """The mass beside the link loads it by m g b cos(a); turned by a small angle it moves -b sin(a) outward, and back
    and forth by b cos(a), across the link."""
    moment, inertia, by_turn, by_rate, by_acceleration = about(bent_arm([0, SIDE, 0]), np.array([1.0, 0, 0]))(
        (0.7, angle, 0.0), (2.0, 0.0, 0.0)
    )
    # Spinning at 2 rad/s, the mass pulls outward with m w^2 x and m w^2 b: both have a moment about the link.
    out = -SIDE * np.sin(angle)
    reach, weight = LENGTH * np.cos(angle), MASS * G
    pull = MASS * 4.0 * reach
    wanted = weight * SIDE * np.cos(angle) - pull * out
    assert moment == pytest.approx(wanted, abs=1e-12)
    assert inertia == pytest.approx(MASS * SIDE**2, abs=1e-12)
    # About the turntable's axis the moment of momentum is m (x^2 + b^2) w.
    assert by_rate[0] == pytest.approx(2 * MASS * 2.0 * reach * out, abs=1e-12)
    # The weight's lever about the lifting joint grows as the mass moves outward, and so does the centrifugal force's.
    raised = 4.0 * MASS * (out * LENGTH * np.sin(angle) + reach * SIDE * np.cos(angle))
    assert by_turn[1] == pytest.approx(weight * out + raised, abs=1e-12)
    assert by_acceleration[1] == pytest.approx(MASS * LENGTH * SIDE, abs=1e-12)


def test_twist_of_an_l_shaped_arm_changes_the_shoulder_by_hand():
    """A twist of m g b cos(a) / K lets the mass down, outward by b sin(a) of it: m g more at the lifting joint."""
    angle, stiffness = 0.5, 900.0
    moment, _, by_turn, _, _ = about(bent_arm([0, SIDE, 0]), np.array([1.0, 0, 0]))((0.0, angle, 0.0))
    wanted = (MASS * G * SIDE) ** 2 * np.sin(angle) * np.cos(angle) / stiffness
    assert -moment / stiffness * by_turn[1] == pytest.approx(wanted, rel=1e-12)


def test_bending_of_a_cantilever_is_the_closed_form():
    """A mass at b beyond the link's far end bends it by m g b cos(a) / k; the lever falls by b sin(a) of a turn."""
    angle = 0.3
    tree = bent_arm([SIDE, 0, 0])
    moment, inertia, by_turn, _, by_acceleration = about(tree, LIFT)((0.0, angle, 0.0))
    assert moment == pytest.approx(MASS * G * SIDE * np.cos(angle), rel=1e-12)
    assert inertia == pytest.approx(MASS * SIDE**2, rel=1e-12)
    assert by_turn[1:] == pytest.approx([-MASS * G * SIDE * np.sin(angle)] * 2, rel=1e-12)
    assert by_acceleration[1:] == pytest.approx([MASS * SIDE * (LENGTH + SIDE), MASS * SIDE**2], rel=1e-12)


def hinged(arm: Arm, link):
    """MuJoCo's arm with free hinges at a link's far end, and the places of the joints and of the hinges."""
    text = arm.mjcf(turns={f"link{link + 1}": dict.fromkeys(range(3), "")})
    model = mujoco.MjModel.from_xml_string(text)
    real = [model.joint(j).dofadr[0] for j in arm.joints]
    hinges = [model.joint(f"link{link + 1}_turn{k}").dofadr[0] for k in range(3)]
    return model, real, hinges


@pytest.mark.parametrize("link", [0, 1, 2])
def test_all_terms_are_what_mujoco_has_with_hinges_at_the_far_end(tmp_path, link):
    arm = random_arm(np.random.default_rng(4), 4, 0.3)
    (tmp_path / "arm.urdf").write_text(arm.urdf())
    tree = load_urdf(tmp_path / "arm.urdf", (0.0, 0.0, -9.81))
    model, real, hinges = hinged(arm, link)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.normal(size=(3, 20, 4))
    found = beam_terms(tree, link, q, qd, qdd)
    end = arm.links[link + 1].origin
    turn = length_axes(end) @ own_axes(end)  # from our axes to the hinges'

    def inverse(k, moved=None, by=0.0):
        for column, own in ((data.qpos, q), (data.qvel, qd), (data.qacc, qdd)):
            column[real], column[hinges] = own[k], 0.0
        if moved is not None:
            (data.qpos, data.qvel, data.qacc)[moved[0]][hinges] = by * turn[:, moved[1]]
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse[real].copy(), turn.T @ data.qfrc_inverse[hinges]

    for k in range(len(q)):
        np.testing.assert_allclose(found.moment[k], inverse(k)[1], rtol=1e-6, atol=1e-6)
        for axis in range(3):
            for order, name in enumerate(("by_turn", "by_rate", "by_acceleration")):
                h = 1e-5
                up, down = (inverse(k, (order, axis), s) for s in (h, -h))
                np.testing.assert_allclose(
                    getattr(found, name)[k, :, axis], (up[0] - down[0]) / (2 * h), rtol=1e-5, atol=2e-5
                )
            np.testing.assert_allclose(found.inertia[k, :, axis], (up[1] - down[1]) / (2 * h), rtol=1e-5, atol=1e-5)


def test_virtual_joints_at_zero_change_no_torque_of_a_tree_with_a_follower():
    one = np.eye(3)
    rng = np.random.default_rng(2)
    arm = bent_arm([SIDE, 0.1, 0.2])
    finger = Joint("finger", "revolute", one[0], 2, one, np.array([0.1, 0, 0]))
    body = from_central(0.4, [0.1, 0.0, 0.05], 0.01 * one)
    tree = Tree(
        "hand", arm.joints, (*arm.links, Link("f", body)), arm.gravity, followers=(Follower(finger, 2, -0.5, 0.3),)
    )
    q, qd, qdd = rng.normal(size=(3, 9, 3))
    wide = [np.insert(x, [2, 2, 2], 0.0, axis=1) for x in (q, qd, qdd)]
    np.testing.assert_allclose(
        RigidBody(cut(tree, 1)).torque(*wide)[:, [0, 1, 5]], RigidBody(tree).torque(q, qd, qdd), atol=1e-12
    )


def test_what_is_a_beam(tmp_path):
    """Neither a link without length, nor the last one, nor one that carries two, nor a rig's; a base is no beam."""
    assert beams(bent_arm([SIDE, 0, 0])) == ("beam",)
    tree = bent_arm([SIDE, 0, 0])
    side = Joint("side", "revolute", np.eye(3)[0], 1, np.eye(3), np.array([0.5, 0.0, 0.0]))
    assert beams(Tree("fork", (*tree.joints, side), (*tree.links, Link("s", np.zeros(10))), tree.gravity)) == ()
    assert beams(built_in_rig()) == ()
    arm = random_arm(np.random.default_rng(4), 3)
    text = arm.urdf().replace(
        '<link name="base"/>',
        '<link name="base"><inertial><mass value="30"/><inertia ixx="4" ixy="0" ixz="0" iyy="5" iyz="0" izz="6"/>'
        "</inertial></link>",
    )
    (tmp_path / "arm.urdf").write_text(text)
    assert beams(floating_tree(load_arm(tmp_path / "arm.urdf", "link3", gravity=(0.0, 0.0, 0.0)))) == ("link1", "link2")
