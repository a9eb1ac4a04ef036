"""The arm as a participant, on a motion that only writes down what it is told: wrenches, impulses, step sizes."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

from types import SimpleNamespace as Made

import numpy as np
import pytest

from snarelab.cosim.participant import StepError
from snarelab.cosim.participants import floating_arm
from snarelab.cosim.participants.floating_arm import FloatingArmParticipant
from snarelab.errors import InputError
from snarelab.models.dormand_prince import StepFault


class Motion:
    """Two joints; its state is a number, and it writes down what a step is given."""

    n_wrenches = 6
    parameters, units = {"servo.a.stiffness": 1.0, "offset": 2.0}, {"servo.a.stiffness": "N*m/rad", "offset": "N*m"}

    def __init__(self, arm, _drive):
        self.arm, self.given, self.fault = arm, [], None

    def start(self, *_):
        return np.zeros(1)

    def joints(self, states):
        return np.tile([0.1, 0.2], (len(states), 1)), np.zeros((len(states), 2))

    def observe(self, _state):
        parts = {"position": 3, "quaternion": 4, "twist": 6}
        shown = {f"{b}_{k}": np.zeros((1, n)) for b in ("tip", "base", "mount") for k, n in parts.items()}
        return Made(momentum=np.zeros((1, 6)), **shown)

    def check(self, _values):
        pass

    def advance(self, *given, **more):
        if self.fault:
            raise self.fault
        self.given.append((*given, more))
        return Made(state=given[1] + 1.0, time=given[2], size=0.3)


@pytest.fixture
def arm_told(monkeypatch):
    monkeypatch.setattr(floating_arm, "FloatingMotion", Motion)

    def make(**options):
        joints = [Made(name="a", kind="revolute"), Made(name="b", kind="prismatic")]
        one = FloatingArmParticipant(Made(tree=Made(joints=joints), mount=None), **options)
        one.initialize(5.0)
        return one

    return make


def inputs(wrench, servo=1.0):
    return np.array([*wrench, 0.1, 0.2, servo])


def test_an_impulse_is_given_evenly_as_a_force_by_the_end_of_each_step(arm_told):
    """By 0.5 s: 3 + 2 · 0.5 + 8 · 0.125 = 5 N·s, all new: 10 N. By 1 s 6 N·s were told, 1 more: 2 N, without slopes."""
    one = arm_told(impulses=True)
    one.set_inputs(inputs([3.0, 0, 0, 0, 0, 0]))
    first, second = np.zeros(9), np.zeros(9)
    first[[0, 6]], second[0] = [2.0, 0.7], 8.0
    one.set_input_derivatives(first, second)
    one.step(5.0, 0.5)
    one.set_inputs(inputs([6.0, 0, 0, 0, 0, 0], servo=0.0))
    one.step(5.5, 0.5)
    (_, _, end, size, held, rates, more), (*_, again, _, later) = one._motion.given
    assert (end, size) == (5.5, 1e-3)
    np.testing.assert_allclose(held, [10.0, 0, 0, 0, 0, 0, 0.1, 0.2])
    np.testing.assert_allclose(rates, [[0, 0, 0, 0, 0, 0, 0.7, 0], np.zeros(8)])
    np.testing.assert_allclose(again, [2.0, 0, 0, 0, 0, 0, 0.1, 0.2])
    assert (more["servo"], later["servo"]) == (True, False)


def test_a_force_is_given_with_its_slopes_and_the_step_goes_on_as_long_as_the_last_one_found(arm_told):
    one = arm_told()
    one.set_inputs(inputs([3.0, 0, 0, 0, 0, 0]))
    first = np.zeros(9)
    first[0] = 2.0
    one.set_input_derivatives(first, np.zeros(9))
    one.step(5.0, 0.5)
    state = one.save()
    one.step(5.5, 0.2)  # no longer than this step itself
    one.restore(state)
    one.step(5.5, 0.5)
    sizes, states = [g[3] for g in one._motion.given], [g[1][0] for g in one._motion.given]
    assert sizes == [1e-3, 0.2, 0.3]
    assert states == [0.0, 1.0, 1.0]
    np.testing.assert_allclose(one._motion.given[0][4][:1], [3.0])
    np.testing.assert_allclose(one._motion.given[0][5][:, 0], [2.0, 0.0])


def test_only_gains_of_the_servo_have_a_least_value_and_names_follow_the_ports(arm_told):
    one = arm_told(impulses=True)
    assert [v.minimum for v in one.variables if v.causality == "parameter"] == [0.0, -np.inf]
    assert one.names("input")[0] == "impulse.tip.x"
    assert one.names("input")[5:] == ("angular_impulse.tip.z", "target.a", "target.b", "servo")
    shown = {v.name: v.unit for v in one.variables}
    assert (shown["q.a"], shown["q.b"], shown["qd.a"], shown["qd.b"]) == ("rad", "m", "rad/s", "m/s")
    assert "pos.mount.x" not in shown
    assert [v.start for v in arm_told(servo=False).variables if v.causality == "input"][-3:] == [0.1, 0.2, 0.0]


def test_what_is_not_finite_or_of_another_length_is_refused_by_name(arm_told):
    one = arm_told(name="left")
    with pytest.raises(InputError, match=r"left: \(8,\) inputs given; give \(9,\)"):
        one.set_inputs(np.zeros(8))
    one.set_inputs(inputs([0, 0, np.inf, 0, 0, 0]))
    with pytest.raises(StepError, match=r"left: at 5 s the input force\.tip\.z is not finite"):
        one.step(5.0, 0.1)
    one.set_inputs(inputs(np.zeros(6)))
    one.set_input_derivatives(np.zeros(9), inputs([0, 0, 0, 0, np.nan, 0]))
    with pytest.raises(StepError, match=r"the input torque\.tip\.y is not finite"):
        one.step(5.0, 0.1)
    one.set_inputs(inputs(np.zeros(6)))
    one._motion.fault = StepFault("too many steps")
    with pytest.raises(StepError, match="left: too many steps; shorten the macro step"):
        one.step(5.0, 0.1)
