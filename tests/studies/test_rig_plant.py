"""The rig study's plant against closed forms and another engine: it must be right before it can judge."""

# pyright: reportAttributeAccessIssue=false

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from snarelab.models.rig.kinematics import suspension_map
from snarelab.models.rig.rig import built_in_rig
from snarelab.studies.zero_g_rig.arm import Arm, arm_of
from snarelab.studies.zero_g_rig.concealed import KINDS, conceal
from snarelab.studies.zero_g_rig.motion import DURATION, HOLDOUT, TRAIN, JointMoves, Move, varied
from snarelab.studies.zero_g_rig.plant import Plant, RigRecord, Sensors, simulate
from snarelab.studies.zero_g_rig.recordings import ANSWER, open_answer, seal
from snarelab.studies.zero_g_rig.slide import Slide
from snarelab.studies.zero_g_rig.suspension import Slings, Suspension

PERFECT = Sensors(encoder_step=1e-15, encoder_noise=0.0, torque_step=0.0, torque_noise=0.0)
BRISK = (Move(0.0, 1, 0.4, 0.1), Move(0.2, 4, -0.5, 0.15), Move(0.4, 5, 0.7, 0.2), Move(0.1, 7, 1.0, 0.3))


def _rigid() -> Arm:
    return arm_of(built_in_rig()).with_booms(torsion=1e9, bending=1e9, damping=1e-3)


def _pinocchio(arm: Arm) -> pin.Model:
    model, joint = pin.Model(), 0
    for k, link in enumerate(arm.links):
        kind = pin.JointModelRX() if link.axis == "x" else pin.JointModelRZ()
        joint = model.addJoint(joint, kind, pin.SE3(np.eye(3), link.offset), f"joint{k + 1}")
        model.appendBodyToJoint(joint, pin.Inertia(link.mass, link.com, link.inertia), pin.SE3.Identity())
    model.gravity.setZero()
    return model


@pytest.fixture(scope="module")
def brisk() -> RigRecord:
    """Four joints at once, without friction, in perfect slings, recorded at every step."""
    return simulate(Plant(_rigid(), None, Suspension(), PERFECT), JointMoves(BRISK), 6.0, rate=200.0)


def test_without_friction_the_slings_leave_zero_gravity(brisk: RigRecord):
    """What the drives give is inverse dynamics without gravity (pinocchio), to half a percent of the peak torque."""
    model = _pinocchio(_rigid())
    data = model.createData()
    qdd = np.gradient(brisk.true_qd, brisk.time, axis=0)
    inner = slice(2, -2)
    rows = zip(brisk.true_q[inner], brisk.true_qd[inner], qdd[inner], strict=True)
    expected = np.array([pin.rnea(model, data, *row) for row in rows])
    error = np.abs(brisk.true_tau[inner] - expected).max(axis=0)
    assert np.all(error < 0.005 * np.abs(expected).max(axis=0) + 0.02)


def test_work_of_the_drives_becomes_kinetic_energy(brisk: RigRecord):
    model = _pinocchio(_rigid())
    data = model.createData()
    power = np.sum(brisk.true_tau * brisk.true_qd, axis=1)
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(brisk.time))])
    states = zip(brisk.true_q, brisk.true_qd, strict=True)
    kinetic = np.array([pin.computeKineticEnergy(model, data, q, qd) for q, qd in states])
    assert np.abs(work - kinetic).max() < 0.01 * kinetic.max()


def test_friction_of_a_slide_is_felt_by_every_parallel_joint_before_it():
    """A couple: two contacts at 0.25 m, the same moment about every vertical axis; joints 2 and 6 feel none of it."""
    arm = _rigid()
    moving = np.array([c.link == 6 for c in arm.contacts])
    slide = Slide(np.where(moving, 40.0, 1e-9), np.where(moving, 40.0, 1e-9), 2e-3, 0.0)
    record = simulate(Plant(arm, slide, Suspension(), PERFECT), JointMoves((Move(0.2, 7, 0.12, 0.02),)), 5.5)
    cruise = np.abs(record.true_qd[:, 6] - 0.02) < 1e-6
    torque = record.true_tau[cruise][-100:].mean(axis=0)
    expected = 2 * 0.25 * slide.steady(np.full(len(arm.contacts), 0.25 * 0.02))[moving][0]
    np.testing.assert_allclose(torque[[0, 2, 3, 4, 6]], expected, rtol=0.01)
    np.testing.assert_allclose(torque[[1, 5]], 0.0, atol=0.02)


def test_a_tension_error_turns_joint_2_by_its_lever_and_leaves_joint_1_alone():
    arm = _rigid()
    error = np.zeros(len(arm.units))
    error[8] = 0.05
    hung = Plant(arm, None, Suspension(error=error), PERFECT)
    record = simulate(hung, JointMoves((Move(0.0, 4, 0.5, 0.2),)), 9.0)
    unit, links = arm.units[8], arm.links
    elbow = np.sum([link.offset for link in links[:4]], axis=0)
    beyond = np.sum([link.offset for link in links[4 : unit.link + 1]], axis=0) + unit.point
    turn, lift = record.true_q[-1, 3], 0.05 * unit.weight
    lever = elbow[1] + np.sin(turn) * beyond[0] + np.cos(turn) * beyond[1]
    assert record.true_tau[-1, 1] == pytest.approx(-lift * lever, rel=0.01)
    assert abs(record.true_tau[-1, 0]) < 1e-3 * abs(record.true_tau[-1, 1])


def test_lugre_settles_on_its_steady_curve():
    slide = Slide(
        np.array([20.0, 20.0]), np.array([30.0, 30.0]), np.array([2e-3, 2e-3]), np.array([400.0, 400.0]), creep=0.01
    )
    z, force = np.zeros(2), np.zeros(2)
    speed = np.array([1e-3, -0.01])
    for _ in range(2000):
        z, force = slide.step(z, speed, 1e-4)
    level = 20.0 + 10.0 * np.exp(-((speed / 2e-3) ** 2))
    closed = speed / (np.abs(speed) * 20.0 / 2e-7 / level + 1 / 0.01) * 20.0 / 2e-7 + 400.0 * speed
    np.testing.assert_allclose(force, closed, rtol=1e-9)
    np.testing.assert_allclose(slide.steady(speed), closed, rtol=1e-12)


def test_a_carriage_lags_by_its_lag_and_a_pin_by_its_play():
    points = np.array([[0.0, 0.0, 0.0]])
    slings = Slings(Suspension(lag=0.5, play=0.01, length=8.0), np.array([400.0]), points)
    for k in range(1, 4001):
        force, acting = slings.step(points + np.array([1e-3 * 0.05 * k, 0.0, 0.0]), 1e-3)
    moved = 0.05 * 4.0
    assert acting[0, 0] == pytest.approx(moved - 0.01, abs=1e-9)
    assert slings.carriage[0, 0] == pytest.approx(acting[0, 0] - 0.5 * 0.05, rel=1e-3)
    assert force[0, 0] == pytest.approx(-400.0 * 0.025 / 8.0, rel=0.01)


def test_slings_that_keep_their_height_act_as_springs():
    points = np.array([[0.0, 0.0, 0.0]])
    slings = Slings(Suspension(height_stiffness=500.0), np.array([400.0]), points)
    for _ in range(100):
        slings.step(points + np.array([0.0, 0.0, 0.01]), 1e-3)
    assert slings.tension[0] == pytest.approx(400.0 - 0.01 / (1 / 500.0 + 1 / 2e5), rel=1e-6)


def test_the_tool_s_stiff_suspension_is_the_plant_s():
    """An arm that rises and sinks on slings that keep their height, slowly: Exudyn's drives beside the effect's law."""
    arm, held = _rigid(), 700.0
    moves = (Move(0.0, 6, 0.4, 0.1), Move(0.0, 2, 0.1, 0.03), Move(0.0, 4, 0.5, 0.1), Move(8.0, 6, -0.6, 0.1))
    tau = [
        simulate(Plant(arm, None, Suspension(height_stiffness=h), PERFECT), JointMoves(moves), 18.0)
        for h in (0.0, held)
    ]
    found = tau[1].true_tau - tau[0].true_tau
    expected = held * suspension_map(built_in_rig(), tau[1].true_q)[:, :, 0]
    assert np.abs(expected).max() > 100.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("moves", [TRAIN, HOLDOUT])
def test_moves_never_overlap_and_the_rate_is_the_position_s(moves: tuple[Move, ...]):
    for joint in range(1, 8):
        own = [m for m in moves if m.joint == joint]
        assert all(a.end <= b.start for a, b in pairwise(own))
    time = np.arange(0.0, DURATION, 1e-2)
    q, qd = JointMoves(varied(moves, np.random.default_rng(3)))(time)
    np.testing.assert_allclose(np.gradient(q, time, axis=0)[1:-1], qd[1:-1], atol=1e-5)


def test_the_answer_is_sealed(tmp_path: Path):
    (tmp_path / ANSWER).write_text(json.dumps(conceal("sensor_drift", 4).answer()))
    digest = seal(tmp_path)
    assert open_answer(tmp_path, digest)["effect"]["name"] == "sensor_drift"
    (tmp_path / ANSWER).write_text("{}")
    with pytest.raises(RuntimeError, match="not the answer that was sealed"):
        open_answer(tmp_path, digest)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_conceals_one_thing_at_a_place_the_model_has(kind: str):
    answer = conceal(kind, 2).answer()["effect"]
    assert answer is None if kind == "none" else answer["name"] == kind
    if answer is not None:
        rig = built_in_rig()
        names = [*(s.name for s in rig.slings), *(x.name for x in rig.links), *(f"tau.{j.name}" for j in rig.joints)]
        assert answer["at"] in names
