"""A wrench at the arm's mount: momentum, work, and the equations of motion by another road; impulses as inputs."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.cosim.participants.floating_arm import FloatingArmParticipant
from snarelab.models.floating.dynamics import inverse_dynamics
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.space_arm import CAPTURE_POSE, space_arm

PLACE, TURN = np.array([2.0, -0.5, 1.0]), Rotation.from_euler("xyz", [0.3, -0.2, 0.5])
AT_TIP, AT_MOUNT = np.array([30.0, -20.0, 40.0, 5.0, 10.0, -7.0]), np.array([-25.0, 60.0, 10.0, -40.0, 3.0, 20.0])


@pytest.fixture(scope="module")
def motion():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SNARELAB_CC", "cc")
        yield FloatingMotion(dataclasses.replace(space_arm(), mount=(TURN.as_matrix(), PLACE)), tolerance=1e-11)


def moving(motion) -> np.ndarray:
    """A state in which everything turns."""
    rng = np.random.default_rng(3)
    momentum = np.concatenate([rng.normal(size=3) * 400, rng.normal(size=3) * 3000])
    return motion.start(CAPTURE_POSE, 0.02 * rng.normal(size=7), [1, 2, 3], rng.normal(size=4), momentum)


def inputs(at_tip, at_mount) -> np.ndarray:
    return np.concatenate([at_tip, at_mount, np.zeros(7)])


def test_action_and_reaction_keep_the_momentum(motion):
    """Opposite forces on tip and mount, moved to one line by a moment: what one gives, the other takes."""
    state, step = moving(motion), 1e-3
    before, apart = motion.observe(state).momentum[0], []
    for k in range(200):
        seen = motion.observe(state)
        apart.append(np.linalg.norm(seen.tip_twist[0, :3] - seen.mount_twist[0, :3]))
        back = -AT_TIP.copy()
        back[3:] -= np.cross(seen.tip_position[0] - seen.mount_position[0], AT_TIP[:3])
        state = motion.advance(k * step, state, (k + 1) * step, inputs=inputs(AT_TIP, back), servo=False).state
    after = motion.observe(state).momentum[0]
    np.testing.assert_allclose(after[:3], before[:3], rtol=0, atol=1e-11 * np.abs(before[:3]).max())
    # the moment is that of the step's start, while the points go on: half a step of their speed, 54 N for 0.2 s
    moved = 0.5 * step * max(apart)
    np.testing.assert_allclose(after[3:], before[3:], rtol=0, atol=np.linalg.norm(AT_TIP[:3]) * 0.2 * moved)
    assert np.abs(motion.joints(state[None])[1] - motion.joints(moving(motion)[None])[1]).max() > 1e-3


def test_wrenches_give_their_impulse_and_their_work(motion):
    start = moving(motion)
    acting = inputs(AT_TIP, AT_MOUNT)
    log = motion.advance(0.0, start, 1.0, inputs=acting, servo=False, longest=1e-3, log=True).log
    time, seen = np.append(0.0, log[:, 0]), motion.observe(np.vstack([start, log[:, 1:]]))
    pairs = ((AT_TIP, seen.tip_position, seen.tip_twist), (AT_MOUNT, seen.mount_position, seen.mount_twist))
    gained = np.ptp(seen.momentum[[0, -1]], axis=0) * np.sign(seen.momentum[-1] - seen.momentum[0])
    np.testing.assert_allclose(gained[:3], AT_TIP[:3] + AT_MOUNT[:3], atol=1e-9)
    moment = sum(np.cross(place, wrench[:3]) + wrench[3:] for wrench, place, _ in pairs)
    np.testing.assert_allclose(gained[3:], np.trapezoid(moment, time, axis=0), atol=1e-4)
    work = sum(np.trapezoid(twist @ wrench, time) for wrench, _, twist in pairs)
    assert seen.energy[-1] - seen.energy[0] == pytest.approx(work, rel=1e-5)


def test_accelerations_ask_for_the_wrench_that_acts(motion):
    """Inverse dynamics, written without a mount, of accelerations by differences over 1 ms; their error is h²."""
    state, h = moving(motion), 1e-3
    acting = inputs(np.zeros(6), AT_MOUNT)
    middle, late = (motion.advance(0.0, state, t, inputs=acting, servo=False).state for t in (h, 2 * h))
    seen = motion.observe(np.vstack([state, middle, late]))
    q, qd = motion.joints(np.vstack([state, middle, late]))
    turn = Rotation.from_quat(seen.base_quaternion[1], scalar_first=True)
    change = (seen.base_twist[2] - seen.base_twist[0]) / (2 * h)
    twist = np.concatenate([turn.apply(part, inverse=True) for part in np.split(seen.base_twist[1], 2)])
    acceleration = np.concatenate([turn.apply(part, inverse=True) for part in np.split(change, 2)])
    qdd = (qd[2] - qd[0]) / (2 * h)
    found = inverse_dynamics(motion.arm, q[[1]], twist[None], qd[[1]], acceleration[None], qdd[None])[0]
    force, torque = (turn.apply(part, inverse=True) for part in np.split(AT_MOUNT, 2))
    wanted = np.concatenate([force, np.cross(PLACE, force) + torque, np.zeros(7)])
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())


def test_impulses_arrive_whole(motion):
    """What was summed up has arrived at each step's end, whatever the shape in between; rollback included."""
    arm = FloatingArmParticipant(motion.arm, q=CAPTURE_POSE, servo=False, impulses=True)
    names = arm.names("input")
    assert names[:7] == (*(f"{k}.tip.{x}" for k in ("impulse", "angular_impulse") for x in "xyz"), "impulse.mount.x")
    arm.initialize()
    held, rng = np.concatenate([np.zeros(12), CAPTURE_POSE, [0.0]]), np.random.default_rng(1)
    linear = [arm.names("output").index(f"momentum.linear.{x}") for x in "xyz"]
    reached = np.zeros(12)
    for k in range(50):
        size = 1e-3 * (1 + k % 3)
        start, reached = reached, reached + rng.normal(size=12) * 0.05
        slope = np.zeros(20)
        slope[:12] = (reached - start) / size
        held[:12] = start
        state = arm.save() if k == 20 else None
        arm.set_inputs(held)
        arm.set_input_derivatives(slope, np.zeros(20))
        arm.step(0.001 * k, size)
        if state is not None:
            once = arm.outputs()
            arm.restore(state)
            arm.set_inputs(held)
            arm.set_input_derivatives(slope, np.zeros(20))
            arm.step(0.001 * k, size)
            assert np.array_equal(arm.outputs(), once)
    np.testing.assert_allclose(arm.outputs()[linear], reached[:3] + reached[6:9], atol=1e-14)
