"""The station arm: what it is built from, and that it moves, brakes and holds as such an arm does."""

import numpy as np
import pytest

from snarelab.errors import InputError
from snarelab.models.floating import dynamics
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.space_arm import (
    BASE_MASS,
    CAPTURE_POSE,
    LENGTH,
    MASS,
    MOUNT,
    ROTOR_INERTIA,
    space_arm,
    space_arm_drive,
)
from snarelab.models.inertia import from_central, is_physical, to_central

POSE = np.array(CAPTURE_POSE)
pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture(scope="module")
def arm():
    return space_arm()


@pytest.fixture(scope="module")
def motion(arm):
    return FloatingMotion(arm, space_arm_drive(arm))


def test_length_and_mass_are_the_data_sheets(arm):
    tip = dynamics.tip_pose(arm, np.zeros((1, 7))).translation[0]
    np.testing.assert_allclose(tip - MOUNT, [0, 0, LENGTH], atol=1e-12)
    assert arm.base[0] + arm.tree.phi[::10].sum() - BASE_MASS == pytest.approx(MASS)
    assert all(is_physical(link.phi) for link in arm.tree.links)


def test_capture_pose_is_far_from_singular(arm):
    """A direction in which the joints cannot move the tip is one in which a passive arm is stiff; stretched, it is."""
    strength = np.linalg.svd(dynamics.generalized_jacobian(arm, POSE[None])[0], compute_uv=False)
    stretched = np.linalg.svd(
        dynamics.generalized_jacobian(space_arm(floating=False), np.zeros((1, 7)))[0], compute_uv=False
    )
    assert strength[-1] > 0.5
    assert stretched[-1] < 1e-9


def test_an_end_effector_adds_to_the_last_link(arm):
    carried = from_central(40.0, [0, 0, 0.2], np.diag([1.0, 1.0, 0.5]))
    mass, com, _ = to_central(space_arm(end_effector=carried).tree.links[-1].phi)
    assert mass == pytest.approx(140.0)
    assert com[2] == pytest.approx((100 * 0.275 + 40 * 0.75) / 140)
    with pytest.raises(InputError, match=r"end_effector has shape \(3,\)"):
        space_arm(end_effector=[1, 2, 3])


def test_servo_moves_the_joints(arm, motion):
    """Critically damped at 1 rad/s in the capture pose: 16 e^-15 of the way is left after 15 s, and friction's part."""
    target = POSE + 0.02
    end = motion.advance(0.0, motion.start(POSE), 15.0, inputs=np.concatenate([np.zeros(6), target])).state
    q, qd = motion.joints(end[None])
    stiffness = np.array([motion.parameters[f"servo.joint{i}.stiffness"] for i in range(1, 8)])
    assert (np.abs(q[0] - target) <= 13.0 / stiffness + 0.02 * 16 * np.exp(-15)).all()
    assert np.abs(qd).max() < 1e-3


def test_passive_joints_hold_below_their_friction_and_give_way_above(arm, motion):
    """The force acts against the joints' levels (13 N·m at breakaway): a twentieth of it creeps, ten times it moves."""
    lever = np.abs(dynamics.tip_jacobians(arm, POSE[None])[1][0, 1]).max()  # of a force along y
    moved = {}
    for share in (0.05, 10.0):
        inputs = np.zeros(13)
        inputs[1] = share * 10.0 / lever
        end = motion.advance(0.0, motion.start(POSE), 5.0, inputs=inputs, servo=False).state
        moved[share] = np.abs(motion.joints(end[None])[0][0] - POSE).max()
    assert moved[0.05] < 2 * 0.05 * 5e-5 * 5.0  # the smooth law's creep: share of the level times its speed
    assert moved[10.0] > 0.005


def test_motors_off_brakes_a_moving_joint(arm, motion):
    """Only friction acts: kinetic energy of arm and rotors falls by what friction takes, here within 1 %."""
    start = motion.start(POSE, [0.0, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0])
    log = motion.advance(0.0, start, 3.0, servo=False, longest=2e-3, log=True).log
    time, states = np.append(0.0, log[:, 0]), np.vstack([start, log[:, 1:]])
    seen, (_, qd) = motion.observe(states), motion.joints(states)
    energy = seen.energy + 0.5 * ROTOR_INERTIA * (qd**2).sum(axis=1)
    p = {
        name.split(".")[2]: value
        for name, value in motion.parameters.items()
        if name.startswith("makkar_friction.joint4")
    }
    slow = qd / p["stribeck_speed"]
    friction = (
        p["stribeck_level"] * (np.tanh(slow) - np.tanh(slow / p["stribeck_ratio"]))
        + p["coulomb_level"] * np.tanh(qd / p["coulomb_speed"])
        + p["viscous_coefficient"] * qd
    )
    lost = np.trapezoid((friction * qd).sum(axis=1), time)
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=0.01)
    assert energy[-1] < 0.5 * energy[0]
    np.testing.assert_allclose(seen.momentum - seen.momentum[0], 0.0, atol=1e-9)
