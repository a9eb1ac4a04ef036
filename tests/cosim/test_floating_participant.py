"""The arm as a participant: exact rollback, also in another instance; what it shows; how it fails."""

import pickle
import time

import numpy as np
import pytest

from snarelab.cosim.participant import StepError
from snarelab.cosim.participants.floating_arm import FloatingArmParticipant
from snarelab.errors import InputError
from snarelab.models.floating.dynamics import tip_pose
from snarelab.models.floating.motion import FloatingMotion
from snarelab.models.floating.space_arm import CAPTURE_POSE, space_arm, space_arm_drive

POSE = np.array(CAPTURE_POSE)
STEP = 1e-3
pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture(scope="module")
def arm():
    return space_arm()


def make(arm) -> FloatingArmParticipant:
    return FloatingArmParticipant(arm, space_arm_drive(arm), q=POSE, servo=False)


def go(participant, first: int, steps: int) -> np.ndarray:
    """Macro steps with a wrench that swings and, on every third, slopes."""
    rows = []
    for k in range(first, first + steps):
        inputs = np.concatenate([np.zeros(6), POSE, [0.0]])
        inputs[:4] = 60 * np.sin(0.02 * k) + 30, 20 * np.cos(0.01 * k), -10.0, 5.0
        participant.set_inputs(inputs)
        if k % 3 == 0:
            participant.set_input_derivatives(np.full(14, 2.0), np.zeros(14))
        participant.step(k * STEP, STEP)
        rows.append(participant.outputs())
    return np.array(rows)


def test_rollback_is_exact_also_in_another_instance(arm):
    participant, other = make(arm), make(arm)
    participant.initialize()
    go(participant, 0, 300)
    state = participant.save()
    once = go(participant, 300, 100)
    participant.restore(state)
    assert np.array_equal(go(participant, 300, 100), once)
    other.initialize(parameters={"makkar_friction.joint1.coulomb_level": 99.0})
    other.restore(pickle.loads(pickle.dumps(state)))
    assert np.array_equal(go(other, 300, 100), once)
    assert np.ptp(once, axis=0).max() > 1e-3


def test_macro_steps_join_up_to_one_run(arm):
    """A held wrench in 1 ms steps against one run with free steps, both at 1e-8 a step."""
    participant = make(arm)
    participant.initialize()
    inputs = np.concatenate([[40.0, 10.0, -20.0, 1.0, 2.0, 3.0], POSE, [0.0]])
    participant.set_inputs(inputs)
    for k in range(500):
        participant.step(k * STEP, STEP)
    motion = FloatingMotion(arm, space_arm_drive(arm))
    end = motion.advance(0.0, motion.start(POSE), 0.5, inputs=inputs[:-1], servo=False).state
    seen = dict(zip(participant.names("output"), participant.outputs(), strict=True))
    np.testing.assert_allclose(
        [seen[f"pos.tip.{axis}"] for axis in "xyz"], motion.observe(end).tip_position[0], atol=1e-7
    )
    np.testing.assert_allclose([seen[f"q.joint{i}"] for i in range(1, 8)], motion.joints(end[None])[0][0], atol=1e-7)
    np.testing.assert_allclose([seen[f"momentum.linear.{axis}"] for axis in "xyz"], 0.5 * inputs[:3], rtol=1e-12)


def test_it_starts_where_it_says(arm):
    participant = make(arm)
    participant.initialize()
    shown = participant.outputs()
    outputs = [v for v in participant.variables if v.causality == "output"]
    np.testing.assert_array_equal(shown, [v.start for v in outputs])
    np.testing.assert_allclose(shown[:3], tip_pose(arm, POSE[None]).translation[0])
    assert len({v.name for v in participant.variables}) == len(participant.variables)
    units = {v.name: v.unit for v in participant.variables}
    assert units["force.tip.x"] == "N"
    assert units["qd.joint3"] == "rad/s"
    assert units["rotor_inertia.joint2.inertia"] == "N*m*s^2/rad"


def test_a_servo_holds_the_start_until_told_otherwise(arm):
    participant = FloatingArmParticipant(arm, space_arm_drive(arm), q=POSE)
    participant.initialize()
    for k in range(20):
        participant.step(0.1 * k, 0.1)
    first = participant.names("output").index("q.joint1")
    np.testing.assert_allclose(participant.outputs()[first : first + 7], POSE, atol=1e-12)


@pytest.mark.parametrize(("switch", "last"), [(0.0, 0.4), (1.0, 0.0)], ids=["off", "on"])
def test_the_last_input_alone_switches_the_motors(arm, switch, last):
    """Told to move the third joint, an arm at rest does so with its motors on, and without them has no reason to."""
    participant = FloatingArmParticipant(arm, space_arm_drive(arm), q=POSE, servo=not switch)
    participant.initialize()
    target = POSE + np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, last])
    participant.set_inputs(np.concatenate([np.zeros(6), target, [switch]]))
    for k in range(5):
        participant.step(0.1 * k, 0.1)
    seen = dict(zip(participant.names("output"), participant.outputs(), strict=True))
    moved = np.array([seen[f"q.joint{i}"] for i in range(1, 8)]) - POSE
    if switch:
        assert 0.01 < moved[2] < 0.3
    else:
        np.testing.assert_allclose(moved, 0.0, atol=1e-12)
    momentum = [seen[f"momentum.{kind}.{axis}"] for kind in ("linear", "angular") for axis in "xyz"]
    np.testing.assert_allclose(momentum, 0.0, atol=1e-6)  # nothing from outside, either way


def test_parameters_change_the_motion_and_are_checked(arm):
    ends = []
    for level in (10.0, 40.0):
        participant = make(arm)
        participant.initialize(parameters={f"makkar_friction.joint{i}.coulomb_level": level for i in range(1, 8)})
        ends.append(go(participant, 0, 200)[-1, :3])
    assert np.abs(ends[0] - ends[1]).max() > 1e-5
    with pytest.raises(InputError, match=r"no parameter 'makkar_friction.joint1.level' \(nearest: makkar_friction"):
        participant.initialize(parameters={"makkar_friction.joint1.level": 1.0})
    with pytest.raises(InputError, match="is -3; allowed is 0 to inf"):
        participant.initialize(parameters={"makkar_friction.joint1.coulomb_level": -3.0})


def test_a_step_that_fails_can_be_rolled_back(arm):
    participant = make(arm)
    participant.initialize()
    go(participant, 0, 10)
    state, before = participant.save(), participant.outputs()
    inputs = np.concatenate([np.zeros(6), POSE, [0.0]])
    inputs[1] = np.nan
    participant.set_inputs(inputs)
    with pytest.raises(StepError, match=r"arm: at 0.01 s the input force.tip.y is not finite"):
        participant.step(0.01, STEP)
    inputs[1] = 1e300
    participant.set_inputs(inputs)
    with pytest.raises(StepError, match="no step is short enough"):
        participant.step(0.01, STEP)
    participant.restore(state)
    assert np.array_equal(participant.outputs(), before)
    with pytest.raises(InputError, match=r"\(3,\) inputs given; give \(14,\)"):
        participant.set_inputs(np.zeros(3))


def test_a_millisecond_takes_much_less_than_a_millisecond(arm):
    participant = make(arm)
    participant.initialize()
    go(participant, 0, 50)
    begun = time.process_time()
    go(participant, 50, 300)
    assert (time.process_time() - begun) / 300 < 0.5 * STEP
