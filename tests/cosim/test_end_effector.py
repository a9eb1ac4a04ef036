"""Carriage, docking and latches on the arm as one participant; the ring under command; commands in the master."""

import numpy as np
import pytest

from snarelab.cosim.master import Master
from snarelab.cosim.participant import Participant, Variable
from snarelab.cosim.participants.hover_end_effector import HoverEndEffectorParticipant
from snarelab.cosim.system import System
from snarelab.errors import InputError
from snarelab.models.docking.arm import carriage_inertia, with_carriage
from snarelab.models.docking.parameters import DockingParameters
from snarelab.models.floating.space_arm import space_arm
from snarelab.models.snare.commanded_ring import CommandedRing, ring_torque
from snarelab.models.snare.drive import ring_motion

BACK = {"front": 0.05}
"""The carriage's front far back, as if it had retracted: the bumpers touch nothing."""


@pytest.fixture(scope="module")
def effector():
    return HoverEndEffectorParticipant((0.0805, 0.0, 0.0), 0.0)


def go(participant, time, size, force=0.0, steps=1, **commands):
    """Steps under a pull of so many newtons between carriage and pin along the axis; outputs by name at the end."""
    names = participant.names("input")
    for _ in range(steps):
        start = participant.pulled
        values = np.zeros(len(names))
        along = np.array([participant.outputs()[participant.names("output").index(f"pos.pin.{a}")] for a in "xyz"])
        along -= [participant.outputs()[participant.names("output").index(f"pos.carriage.{a}")] for a in "xyz"]
        along /= np.linalg.norm(along)
        participant.pulled = start + force * size * along
        for k, axis in enumerate("xyz"):
            values[names.index(f"impulse.carriage.{axis}")] = participant.pulled[k]
            values[names.index(f"impulse.pin.{axis}")] = -participant.pulled[k]
        for name, value in commands.items():
            values[names.index(name)] = value
        participant.set_inputs(values)
        participant.step(time, size)
        time += size
    return dict(zip(participant.names("output"), participant.outputs(), strict=True))


def momentum(out):
    return np.array([out[f"momentum.linear.{a}"] + out[f"momentum.target.linear.{a}"] for a in "xyz"])


def energy(out):
    return out["energy.kinetic"] + out["energy.stored"] - sum(
        sign * out[f"energy.{name}"]
        for name, sign in (("motor", 1), ("carriage_lost", -1), ("brake", -1), ("contact_lost", -1), ("latches", -1),
                           ("joints", -1), ("cables", 1))
    )  # fmt: skip


def test_the_carriage_is_a_part_of_the_last_link():
    arm, p = space_arm(), DockingParameters()
    more = with_carriage(arm, p)
    assert sum(link.phi[0] for link in more.tree.links) == pytest.approx(sum(link.phi[0] for link in arm.tree.links))
    assert more.n_joints == arm.n_joints + 1
    assert carriage_inertia(p.carriage_mass)[0] == p.carriage_mass
    with pytest.raises(InputError, match="a carriage of 90 kg is no part of 'link7' of 100 kg"):
        with_carriage(arm, DockingParameters(carriage_mass=90.0))


def test_preload_latch_and_let_go(effector):
    """Pulled into the seat, latched, and held when the pull ends: nothing is lost of momentum or energy."""
    effector.initialize(parameters=BACK)
    effector.pulled = np.zeros(3)
    first = go(effector, 0.0, 1e-3)
    out = go(effector, 0.001, 4e-3, 1000.0, 300, brake=1.0)
    assert out["switches"] == 3
    share = 1000.0 / (6 * np.sin(np.pi / 4))
    normals = [out[f"normal.{k}"] for k in range(1, 7)]
    # Friction bears a part of the axial load: by μ tan γ at most.
    assert np.mean(normals) == pytest.approx(share, rel=0.16)
    assert min(normals) > 0.5 * share
    out = go(effector, 1.201, 4e-3, 1000.0, 800, brake=1.0, latch=1.0)
    assert out["closed"] == 3
    out = go(effector, 4.401, 4e-3, 0.0, 200, brake=1.0, latch=1.0, servo=1.0)
    assert out["closed"] == out["switches"] == 3
    # What is left is the latches' own preload, 1 kN each.
    assert sum(out[f"normal.{k}"] for k in range(1, 7)) > 3 * share
    assert max(abs(out[f"off.{i}.lateral"]) for i in (1, 2, 3)) < 5e-5
    assert np.abs(momentum(out) - momentum(first)).max() < 1e-9 * 1000.0 * 5
    assert abs(energy(out) - energy(first)) < 1e-4 * max(abs(out["energy.cables"]), 1e-2)


def test_a_saved_effector_goes_on_alike_bit_for_bit(effector):
    effector.initialize(parameters=BACK)
    effector.pulled = np.zeros(3)
    go(effector, 0.0, 2e-3, 300.0, 20, speed=0.004, motor=1.0)
    state, pulled = effector.save(), effector.pulled.copy()
    once = go(effector, 0.04, 2e-3, 300.0, 20, brake=1.0, latch=1.0)
    effector.restore(state)
    effector.pulled = pulled
    assert go(effector, 0.04, 2e-3, 300.0, 20, brake=1.0, latch=1.0) == once
    assert once["energy.contact_lost"] != 0


def test_the_carriage_follows_its_command_and_stops_at_its_end(effector):
    effector.initialize(parameters={"stroke": 0.003} | BACK)
    effector.pulled = np.zeros(3)
    out = go(effector, 0.0, 5e-3, 0.0, 50, speed=0.01, motor=1.0)
    assert out["rate"] == pytest.approx(0.01, rel=1e-3)
    assert out["force.motor"] == pytest.approx(20.0 + 200.0 * 0.01, rel=1e-2)  # friction by hand
    out = go(effector, 0.25, 5e-3, 0.0, 100, speed=0.01, motor=1.0)
    assert out["travel"] < 0.0038
    assert out["force.motor"] == pytest.approx(2 * np.pi * 0.9 / 0.005 * 6.5, rel=1e-6)  # its limit
    with pytest.raises(InputError, match="nearest is 'stroke'"):
        effector.initialize(parameters={"strok": 1.0})


def test_a_commanded_ring_moves_as_the_parameters_ramp_does():
    ring = CommandedRing(0.1)
    ring.command(0.0, 0.14)
    for time in (0.0, 0.03, 0.1, 0.4, 1.0):
        np.testing.assert_allclose(ring(time), ring_motion(time, 0.14, 0.14, 0.1), atol=1e-15)
    ring.command(1.0, 0.0)
    for time in (1.02, 1.1, 1.5):
        np.testing.assert_allclose(ring(time), ring_motion(time, 0.14, 0.14, 0.1), atol=1e-15)
    ring.command(2.0, -0.1)
    assert ring(3.0)[0] == pytest.approx(0.14 - 0.1 * 0.95)


def test_the_rings_torque_is_that_of_the_forces_on_the_rotating_ring():
    frame = np.vstack([np.zeros((3, 3)), np.eye(3)])
    points, ends = np.zeros((6, 3)), np.zeros((6, 3))
    points[1], ends[1] = [0.1, 0.13, 0.0], [5.0, 0.0, 10.0]
    points[0], ends[0] = [0.0, 0.13, 0.0], [0.0, 0.0, 77.0]  # on the fixed ring: does not count
    assert ring_torque(ends, points, frame) == pytest.approx(1.3)


class Clock(Participant):
    """Gives 0, then 1 from its third period on, and logs the change."""

    name, can_restore = "clock", True
    variables = (Variable("on", "output", "1", discrete=True),)

    def initialize(self, time=0.0, parameters=None):
        self.now = time

    def set_inputs(self, values):
        pass

    def step(self, time, size):
        self.now = time + size

    def next_event(self, time):
        return 0.1 * (np.floor(time / 0.1 + 1e-6) + 1)

    def events(self):
        return ("on",) if abs(self.now - 0.3) < 1e-9 else ()

    def outputs(self):
        return np.array([float(self.now > 0.3 - 1e-9)])


class Reader(Participant):
    """Keeps what it is given."""

    name, input_order = "reader", 2
    variables = (Variable("on", "input", "1"), Variable("t", "output", "1"))

    def initialize(self, time=0.0, parameters=None):
        self.given, self.slopes, self.steps = [], [], []

    def set_inputs(self, values):
        self.given.append(float(values[0]))

    def set_input_derivatives(self, first, second):
        self.slopes += [float(first[0]), float(second[0])]

    def step(self, time, size):
        self.steps.append(size)

    def outputs(self):
        return np.zeros(1)


@pytest.mark.parametrize("scheme", ["jacobi", "gauss_seidel"])
def test_a_command_is_held_and_its_events_cut_the_step(scheme):
    clock, reader = Clock(), Reader()
    with Master(System({"clock": clock, "reader": reader}, [("clock.on", "reader.on")]), 0.07, scheme=scheme,
                hold="quadratic") as master:  # fmt: skip
        run = master.run(0.5)
    assert set(reader.given) == {0.0, 1.0}  # no line or parabola through the change
    assert not any(reader.slopes)
    np.testing.assert_allclose(np.cumsum(reader.steps)[1::2], [0.1, 0.2, 0.3, 0.4, 0.5])
    assert sum(reader.given) == pytest.approx(4)
    assert [event.text for event in run.log] == ["clock: on"]


def test_many_short_runs_are_one():
    clock, reader = Clock(), Reader()
    with Master(System({"clock": clock, "reader": reader}, [("clock.on", "reader.on")]), 0.05) as master:
        master.go_to(0.2)
        master.set_step(0.025)
        master.go_to(0.4)
        run = master.result()
    np.testing.assert_allclose(run.recording["time"], [*np.arange(0, 0.2, 0.05), *np.arange(0.2, 0.401, 0.025)])
