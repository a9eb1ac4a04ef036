"""The snare as a participant: its variables, its paths between inputs, exact repetition, and its errors."""

# pyright: reportArgumentType=false

import numpy as np
import pytest

from snarelab.cosim.participant import StepError
from snarelab.cosim.participants.snare import SnareParticipant
from snarelab.errors import InputError
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

QUICK = SnareParameters(ring_rate=np.deg2rad(40))
PIN = [0.2369, 0.0747, 0.0402]


def pose(position, velocity=(0, 0, 0), spin=(0, 0, 0)):
    return [*position, 1, 0, 0, 0, *velocity, *spin]


def test_variables_are_named_as_recordings_are():
    moved = SnareParticipant(QUICK)
    assert moved.names("input")[:5] == ("pos.effector.x", "pos.effector.y", "pos.effector.z", "quat.effector.w",
                                        "quat.effector.x")  # fmt: skip
    assert len(moved.names("input")) == 26
    assert len(moved.names("output")) == 13
    own = SnareParticipant(QUICK, Target("free"))
    assert len(own.names("input")) == 13
    assert own.names("output")[13:16] == ("pos.pin.x", "pos.pin.y", "pos.pin.z")
    assert "hertz_stiffness" in own.names("parameter")


def drive(participant, start, n_steps, size=2e-3):
    for k in range(start, start + n_steps):
        lift = 1e-3 * np.sin(0.05 * k)
        participant.set_inputs(np.array(pose([0, lift, 0], [0, 0.025 * np.cos(0.05 * k), 0]) + pose(PIN)))
        participant.step(k * size, size)
    return participant.outputs()


def test_repeats_bitwise_after_restore_and_in_another_instance():
    one = SnareParticipant(QUICK)
    one.initialize(0.0, {"friction": 0.2})
    drive(one, 0, 310)
    saved = one.save()
    first = drive(one, 310, 30)
    assert np.linalg.norm(first[:3]) > 0.1  # in contact
    one.restore(saved)
    assert np.array_equal(drive(one, 310, 30), first)
    other = SnareParticipant(QUICK)
    other.initialize()
    other.restore(saved)
    assert np.array_equal(drive(other, 310, 30), first)
    assert first[12] == pytest.approx(np.deg2rad(40) * (0.68 - 0.05))


def test_held_inputs_stand_for_the_middle_of_the_step_and_derivatives_for_its_course():
    """A body on a parabola, told both ways: where it is at the end of the step."""
    size, acceleration = 0.01, 3.0
    for with_derivatives in (False, True):
        snare = SnareParticipant(QUICK)
        snare.initialize()
        for k in range(5):
            t = k * size + (0 if with_derivatives else size / 2)
            values = pose([0, acceleration * t**2 / 2, 0], [0, acceleration * t, 0])
            snare.set_inputs(np.array(values + pose(PIN)))
            if k == 0:  # the model starts where the inputs are
                start = values[1]
            if with_derivatives:
                rates = np.zeros(26)
                rates[8] = acceleration
                snare.set_input_derivatives(rates, np.zeros(26))
            snare.step(k * size, size)
        end = snare.save()[0].frames[0][0][1] + start
        assert end == pytest.approx(acceleration * (5 * size) ** 2 / 2, abs=1e-12 if with_derivatives else 4e-5)


def test_errors_are_one_line_and_leave_the_state():
    snare = SnareParticipant(QUICK)
    with pytest.raises(InputError, match="no parameter 'frction'"):
        snare.initialize(0.0, {"frction": 0.1})
    snare.initialize()
    with pytest.raises(InputError, match=r"\(3,\) inputs given; give \(26,\)"):
        snare.set_inputs(np.zeros(3))
    values = np.array(pose([0, 0, 0]) + pose(PIN))
    snare.set_inputs(values)
    snare.step(0.0, 1e-3)
    before = snare.outputs()
    values[1] = np.nan
    snare.set_inputs(values)
    with pytest.raises(StepError, match=r"at 0.001 s the input pos.effector.y is not finite"):
        snare.step(1e-3, 1e-3)
    values[1], values[3] = 0, 0.5
    snare.set_inputs(values)
    with pytest.raises(StepError, match="give a unit quaternion"):
        snare.step(1e-3, 1e-3)
    assert np.array_equal(snare.outputs(), before)
