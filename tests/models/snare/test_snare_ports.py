"""The snare as a participant, on models that only write down what they are told: paths, sums, rollback."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalMemberAccess=false

from types import SimpleNamespace as Made

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.cosim.participant import StepError
from snarelab.cosim.participants import snare, snare_impulses
from snarelab.cosim.participants.snare import SnareParticipant
from snarelab.cosim.participants.snare_impulses import ImpulseSnareParticipant
from snarelab.errors import InputError
from snarelab.models.snare.drive import Pose
from snarelab.models.snare.model import SnareStepError
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

EFFECTOR = [0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0, 1.0, -2.0, 0.5, 0.0, 0.0, 0.3]
PIN = [0.4, 0.0, 0.1, np.cos(0.1), np.sin(0.1), 0.0, 0.0, 0.0, 3.0, 0.0, 0.2, 0.0, 0.0]
"""Position, quaternion, velocity and angular velocity: the effector turns about its z, the pin about its x."""


class Told:
    """A snare's model that writes down what it is built from and where its bodies are to go."""

    ring_angle = 0.7
    fault: Exception | None = None

    def __init__(self, parameters, target, accuracy, effector, start, drive=None):
        self.made = parameters, target, accuracy, effector, start
        self.calls, self.restored = [], []

    def move_effector(self, pose):
        self.calls.append(("effector", pose))

    def move_target(self, pose):
        self.calls.append(("target", pose))

    def step(self, size):
        if self.fault:
            raise self.fault
        self.calls.append(("step", size))

    def wrenches(self):
        return np.arange(6.0), 10.0 + np.arange(6.0)  # pin, effector

    def target_pose(self):
        return Pose(np.array([1.0, 2.0, 3.0]), np.eye(3), np.array([4.0, 5.0, 6.0]), np.array([7.0, 8.0, 9.0]))

    def save(self):
        return "state", len(self.calls)

    def restore(self, state):
        self.restored.append(state)


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(snare, "SnareModel", Told)


def test_held_inputs_put_a_body_half_a_step_ahead(told):
    """Over 0.2 s: positions by velocity times 0.1 s, turns of 0.03 rad about z and 0.02 rad about x."""
    one = SnareParticipant()
    one.initialize()
    one.set_inputs(np.array(EFFECTOR + PIN))
    one.step(0.0, 0.2)
    (_, effector), (_, pin), step = one._model.calls
    assert step == ("step", 0.2)
    np.testing.assert_allclose(effector.position, [0.2, 0.0, 0.35], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(pin.position, [0.4, 0.3, 0.1], rtol=1e-12)
    np.testing.assert_allclose(Rotation.from_matrix(effector.rotation).as_rotvec(), [0.0, 0.0, 0.03], atol=1e-12)
    np.testing.assert_allclose(Rotation.from_matrix(pin.rotation).as_rotvec(), [0.22, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose((pin.velocity, pin.angular_velocity), [[0.0, 3.0, 0.0], [0.2, 0.0, 0.0]])


def test_derivatives_lead_a_body_along_its_course_to_the_end_of_the_step(told):
    """v t + a t²/2 + j t³/6, with t = 0.2 s; derivatives of poses are not read, as twists are those."""
    one = SnareParticipant()
    one.initialize()
    one.set_inputs(np.array(EFFECTOR + PIN))
    first, second = np.full(26, 99.0), np.full(26, -99.0)
    acceleration, jerk = np.arange(1.0, 13.0), np.arange(30.0, 18.0, -1.0)
    for rates, values in ((first, acceleration), (second, jerk)):
        rates[7:13], rates[20:26] = values[:6], values[6:]
        rates[[10, 11, 24, 25]] = 0.0  # each turns about its own axis
    one.set_input_derivatives(first, second)
    one.step(0.0, 0.2)
    (_, effector), (_, pin), _ = one._model.calls
    for pose, start, at in ((effector, EFFECTOR, 7), (pin, PIN, 20)):
        for shown, here in ((pose.velocity, 0), (pose.angular_velocity, 3)):
            a, j = first[at + here : at + here + 3], second[at + here : at + here + 3]
            np.testing.assert_allclose(shown, start[7 + here : 10 + here] + 0.2 * a + 0.02 * j, rtol=1e-12)
        way = 0.2 * np.array(start[7:]) + 0.02 * first[at : at + 6] + 0.008 / 6 * second[at : at + 6]
        np.testing.assert_allclose(pose.position, start[:3] + way[:3], rtol=1e-12)
        turned = Rotation.from_matrix(pose.rotation) * Rotation.from_quat(start[3:7], scalar_first=True).inv()
        np.testing.assert_allclose(turned.as_rotvec(), way[3:], atol=1e-12)


def test_a_model_is_built_once_where_the_first_inputs_put_its_bodies(told):
    one = SnareParticipant(SnareParameters(), accuracy="fine")
    one.initialize(1.5, {"friction": 0.25})
    one.set_inputs(np.array(EFFECTOR + PIN))
    one.outputs()
    parameters, target, accuracy, effector, start = one._model.made
    assert (parameters.friction, accuracy, start) == (0.25, "fine", 1.5)
    np.testing.assert_allclose(effector.position, EFFECTOR[:3])
    np.testing.assert_allclose((effector.velocity, effector.angular_velocity), [EFFECTOR[7:10], EFFECTOR[10:]])
    np.testing.assert_allclose([*target.position, *target.orientation, *target.velocity, *target.angular_velocity], PIN)
    model = one._model
    one.set_inputs(np.array(PIN + EFFECTOR))
    one.step(1.5, 0.1)
    assert one._model is model
    one.initialize()
    assert one._model is None


def test_wrenches_come_effector_first_and_a_pin_that_moves_by_itself_is_shown(told):
    moved, own = SnareParticipant(), SnareParticipant(target=Target("free"))
    for one in (moved, own):
        one.initialize()
    expected = [*(10.0 + np.arange(6)), *np.arange(6.0), 0.7]
    np.testing.assert_allclose(moved.outputs(), expected)
    np.testing.assert_allclose(own.outputs(), [*expected, 1, 2, 3, 1, 0, 0, 0, 4, 5, 6, 7, 8, 9])
    own.set_inputs(np.array(EFFECTOR))
    own.step(0.0, 0.1)
    assert [name for name, _ in own._model.calls] == ["effector", "step"]


def test_a_state_comes_back_in_the_same_model_or_in_one_built_from_the_same_start(told):
    one, other = SnareParticipant(), SnareParticipant()
    one.initialize(1.0, {"friction": 0.25})
    one.set_inputs(np.array(EFFECTOR + PIN))
    one.step(1.0, 0.1)
    saved, model = one.save(), one._model
    one.set_inputs(np.array(PIN + EFFECTOR))
    one.restore(saved)
    assert one._model is model
    np.testing.assert_array_equal(one._inputs, EFFECTOR + PIN)
    for time, given in ((0.0, {}), (1.0, {}), (0.0, {"friction": 0.25}), (1.0, {"friction": 0.25})):
        other.initialize(time, given)
        other.outputs()  # at its own first place
        before = other._model
        other.restore(saved)
        assert other._model is not before
        assert other._model.made[0].friction == 0.25
        assert other._model.made[4] == 1.0
        np.testing.assert_allclose(other._model.made[3].position, EFFECTOR[:3])
        assert other._model.restored == [("state", 3)]


@pytest.mark.parametrize("fault", [SnareStepError("no convergence"), InputError("no convergence")])
def test_a_models_fault_is_a_failed_step_under_the_snares_name(told, fault):
    one = SnareParticipant(name="catcher")
    one.initialize()
    one.outputs()
    one._model.fault = fault
    with pytest.raises(StepError, match=r"^catcher: no convergence$"):
        one.step(0.0, 0.1)


def test_parameters_of_a_snare_have_their_least_values():
    """What must be positive starts above zero, what may be none at zero."""
    least = {v.name: v.minimum for v in SnareParticipant().variables if v.causality == "parameter"}
    assert 0 < least["pin_radius"] < 1e-9
    assert least["friction"] == 0.0


# Impulses

ORIGIN = np.array([10.0, 20.0, 30.0])


class Summed:
    """A snare's model about an origin of its own, whose effector and pin move by 2 cm and 4 cm along x in a step."""

    origin, ring_angle = ORIGIN, 0.0

    def __init__(self):
        self.taken = 0
        self.assembly = Made(pin=np.zeros((6, 3)))

    def move_effector(self, _pose):
        pass

    move_target = move_effector

    def step(self, _size):
        self.taken += 1
        self.assembly.pin[0, 0] += 0.04

    def effector_pose(self):
        return Made(position=ORIGIN + np.array([0.02 * self.taken, 0.5, 0.0]))

    def pin_impulse(self):
        return self.taken * np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0])

    def wrenches(self):
        return np.zeros(6), np.zeros(6)

    def energies(self):
        return {name: float(i) for i, name in enumerate(snare_impulses._ENERGIES)}


def test_moments_are_about_the_middle_of_the_step_and_momentum_about_the_worlds_origin(monkeypatch):
    """In a step cables gain P = (1, 0, 0) and no moment; the pin gets 2 N·s along z, with its foot at x = 0.02 m.

    I = -P - (0, 0, 2). About the effector at (0.01, 0.5, 0): T = -x × I - x_pin × I_pin.
    """
    monkeypatch.setattr(snare_impulses, "momentum", lambda _: np.array([model.taken, 0.0, 0.0, 0.0, 0.0, 0.0], float))
    model = Summed()
    one = ImpulseSnareParticipant()
    one.initialize()
    one._model = model
    one.step(0.0, 1e-3)
    shown = dict(zip(one.names("output"), one.outputs(), strict=True))

    def of(stem):
        return np.array([shown[f"{stem}.{a}"] for a in "xyz"])

    impulse = np.array([-1.0, 0.0, -2.0])
    np.testing.assert_allclose(of("impulse.effector"), impulse)
    moment = -np.cross([0.01, 0.5, 0.0], impulse) - np.cross([0.02, 0.0, 0.0], [0.0, 0.0, 2.0])
    np.testing.assert_allclose(of("angular_impulse.effector"), moment, atol=1e-12)
    np.testing.assert_allclose(of("impulse.pin"), [0.0, 0.0, 2.0])
    np.testing.assert_allclose(of("momentum.linear"), [1.0, 0.0, 0.0])
    np.testing.assert_allclose(of("momentum.angular"), np.cross(ORIGIN, [1.0, 0.0, 0.0]))
    assert [shown[f"energy.{name}"] for name in snare_impulses._ENERGIES] == list(range(8))
    one.initialize()
    assert not one._passed.any()
    assert not one._momentum.any()


def test_cables_stand_about_the_worlds_origin_and_the_largest_end_force_is_the_tension():
    """Nodes (r, r') of 3 cables with 2 nodes each, moved by 1 m; six ends, one of which pulls with 3 : 4 : 12."""
    nodes = np.arange(36.0).reshape(3, 2, 2, 3)
    ends = np.zeros((6, 3))
    ends[1], ends[4] = [3.0, 4.0, 12.0], [12.0, 0.0, 0.0]
    data = Made(
        GetODE2Coordinates=lambda: np.ones(40),
        GetAECoordinates=lambda: np.concatenate([[1e9], ends.ravel()]),
        GetObjectLTGAE=lambda number: np.arange(1, 19) if number == 5 else None,
    )
    assembly = Made(system=Made(systemData=data), nodes=nodes, n_cable_coordinates=36, ends_object=5)
    one = ImpulseSnareParticipant()
    one.initialize()
    one._model = Made(assembly=assembly, origin=ORIGIN)
    np.testing.assert_allclose(one.cables()[1, 1], [18.0, 19.0, 20.0] + ORIGIN + 1.0)
    assert one.cables().shape == (3, 2, 3)
    assert one.tension() == pytest.approx(13.0)
