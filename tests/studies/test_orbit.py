"""Captures in orbit, shortened: a ring ten times as fast touches after 0.7 s. Co-simulated, and as one system."""

import dataclasses

import numpy as np
import pytest

from snarelab.cosim.participants.snare_impulses import ImpulseSnareParticipant
from snarelab.cosim.step_control import StepControl
from snarelab.errors import InputError
from snarelab.models.floating.space_arm import FRICTION
from snarelab.models.monolithic.assembly import makkar
from snarelab.models.snare.model import Accuracy
from snarelab.studies.orbit import setting as orbit
from snarelab.studies.orbit.ledger import energy_ledger, force_error, momentum_ledger, position_error
from snarelab.studies.orbit.reference import reference
from snarelab.studies.orbit.setting import JointResistance, capture_of, co_simulate, setting, step_control

FAST = dataclasses.replace(orbit.SNARE, ring_rate=10 * orbit.SNARE.ring_rate, ring_ramp=0.02)
LENGTH = 0.85


@pytest.fixture(scope="module", params=["inspection", "hover"])
def pair(request):
    start, passive = setting(request.param), JointResistance()
    run = co_simulate(start, passive, FAST, duration=LENGTH)
    single = reference(start, passive, FAST, LENGTH, every=0.005)
    return start, passive, run, capture_of(run, request.param), single


def test_co_simulation_and_one_system_agree(pair):
    """Issue's bars: 0.05 mm, and 2 % of the force, at macro steps of 1 ms."""
    _, _, run, capture, (single, _) = pair
    assert run.steps == 850
    assert capture.first_contact == pytest.approx(single.first_contact, abs=2e-3)
    assert 0.6 < capture.first_contact < 0.8
    assert position_error(capture, single) < 5e-5
    assert force_error(capture, single) < 0.02
    joints = np.array([np.interp(single.times, capture.times, q) for q in capture.q.T]).T
    assert np.abs(single.q - single.q[0]).max() > 1e-5  # they moved
    np.testing.assert_allclose(joints, single.q, atol=0.02 * np.abs(single.q - single.q[0]).max())


def test_momentum_is_kept(pair):
    """Of base, arm, cables and target, both ways; Exudyn's integrator keeps the linear part by itself."""
    _, _, run, capture, (_, total) = pair
    ledger = momentum_ledger(run, capture)
    assert ledger.scale[0] > 0.1
    assert ledger.drift < 1e-6
    # Newton's tolerance is left: the base's part of a contact's Jacobian is not given
    assert np.linalg.norm(total[:, :3] - total[0, :3], axis=1).max() < 1e-6 * ledger.scale[0]


def test_the_impulse_is_that_of_the_force(pair):
    """Impulses follow from what cables and target gained; the constraints' forces are another witness."""
    _, _, run, capture, _ = pair
    force = orbit.columns(run.recording, "force.effector")
    summed = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(capture.times)[:, None], axis=0)
    # two rules of integration differ by about a tenth of a step's impulse while forces last
    np.testing.assert_allclose(capture.impulse[1:], summed, atol=0.2 * 1e-3 * np.abs(force).max())


def test_energy_is_accounted_for(pair):
    start, passive, run, capture, _ = pair
    ledger = energy_ledger(run, capture, start, passive)
    assert np.abs(ledger["residual"]).max() < 0.03 * np.abs(ledger["motor"]).max()
    assert all(ledger[name].min() > -1e-9 for name in ("lost in joints", "lost in cables and contacts"))


def test_the_controlled_step_is_rejected_at_first_contact():
    start = setting("hover")
    run = co_simulate(start, JointResistance(), FAST, duration=0.76, control=step_control(start))
    contact = capture_of(run, "hover").first_contact
    assert contact is not None
    assert run.rejected > 0
    assert any(abs(event.time - contact) < 0.02 and "rejected" in event.text for event in run.log)


@pytest.mark.parametrize("case", ["inspection", "hover"])
def test_rollback_of_the_snare_with_impulses(case):
    """In contact, also in another instance; bit for bit."""
    rapid = dataclasses.replace(FAST, ring_rate=40 * orbit.SNARE.ring_rate, ring_ramp=0.01)
    start = setting(case)
    first, other = (
        ImpulseSnareParticipant(rapid, start.target, Accuracy(1e-3, 10, 5e-4), start.effector) for _ in range(2)
    )
    held = np.array([v.start for v in first.variables if v.causality == "input"])

    def go(snare, begin, steps):
        rows = []
        for k in range(begin, begin + steps):
            snare.set_inputs(held)
            snare.step(k * 1e-3, 1e-3)
            rows.append(snare.outputs())
        return np.array(rows)

    for snare in (first, other):
        snare.initialize()
        snare.set_inputs(held)
    go(first, 0, 185)
    state = first.save()
    once = go(first, 185, 10)
    touching = first.names("output").index("force.pin.y")
    assert np.abs(once[:, touching]).min() > 0
    first.restore(state)
    assert np.array_equal(go(first, 185, 10), once)
    go(other, 0, 3)
    other.restore(state)
    assert np.array_equal(go(other, 185, 10), once)


def test_friction_by_hand_is_the_registrys():
    speed = np.array([-1e-3, -2e-5, 0.0, 1e-5, 4e-4, 0.03])
    torque, slope = makkar(FRICTION, speed)
    f = FRICTION
    bump = np.tanh(speed / f["stribeck_speed"]) - np.tanh(speed / f["stribeck_speed"] / f["stribeck_ratio"])
    wanted = f["stribeck_level"] * bump + f["coulomb_level"] * np.tanh(speed / f["coulomb_speed"])
    np.testing.assert_allclose(torque, wanted + f["viscous_coefficient"] * speed, rtol=1e-12, atol=1e-15)
    ahead = makkar(FRICTION, speed + 1e-10)[0] - makkar(FRICTION, speed - 1e-10)[0]
    np.testing.assert_allclose(slope, ahead / 2e-10, rtol=1e-4)


def test_end_stiffness_is_not_for_one_system():
    with pytest.raises(InputError, match=r"end_stiffness is 0.1 N\*m/rad; give 0, or co-simulate"):
        reference(setting("hover"), JointResistance(), dataclasses.replace(FAST, end_stiffness=0.1), 0.01)


def test_control_takes_known_names():
    assert isinstance(step_control(setting("inspection")), StepControl)
