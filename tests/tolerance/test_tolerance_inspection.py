"""The inspection capture of tolerance studies: how the arm arrives, what its cables bear, cases at the box's ends."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipk

import snarelab
from snarelab.cosim.orbit_capture import SNARE, arrival, capture_of, co_simulate, resistance, step_control
from snarelab.models.floating.space_arm import FRICTION
from snarelab.studies.orbit.setting import setting
from snarelab.tolerance import inspection
from snarelab.tolerance.run import box_points
from snarelab.tolerance.study import load_study

TILT = np.deg2rad(2.0)
TURN = Rotation.from_euler("xyz", [TILT, TILT, TILT])
FOOT = np.array([0.12, 0.02, 0.02])
ARRIVED = {
    **{axis.name: axis.nominal for axis in inspection.AXES},
    **dict.fromkeys(("radial_y", "radial_z"), 0.02),
    **dict.fromkeys(("roll", "pitch", "yaw"), TILT),
}
INSPECTION = Path(snarelab.__file__).parent / "tolerance" / "inspection.toml"


def test_the_papers_arrival_is_the_orbit_studys():
    ours, theirs = arrival("inspection", FOOT, TURN), setting("inspection")
    assert ours.target == theirs.target
    assert not ours.rates.any()
    assert not ours.drift.any()


def relative(start, level, duration):
    run = co_simulate(
        start, resistance(level), duration=duration, own_step=2e-3, control=step_control(start, 0.05, 16e-3)
    )
    motion = capture_of(run, "inspection")
    return motion, motion.times, motion.relative


def test_an_arm_that_still_moves_closes_in_at_its_speed_until_friction_has_stopped_it():
    start = arrival("inspection", FOOT, TURN, speed=0.01)
    motion, times, place = relative(start, 0.01, 0.01)
    rate = (place[-1] - place[0]) / (times[-1] - times[0])
    np.testing.assert_allclose(rate, [-0.01, 0.0, 0.0], atol=1e-4)
    np.testing.assert_allclose(motion.tip[0, 1:3], 0.0, atol=1e-12)  # the world is the one where the tip rests
    turned = motion.tip[-1, 3:].T @ motion.pin[-1, 3:]
    np.testing.assert_allclose(turned, TURN.as_matrix(), atol=1e-6)
    _, times, place = relative(start, 100.0, 1.0)
    assert np.abs(np.diff(place[-5:], axis=0) / np.diff(times[-5:])[:, None]).max() < 5e-4
    assert FOOT[0] - 0.01 < place[-1, 0] < FOOT[0] - 1e-4


def test_friction_in_proportion():
    passive = resistance(30.0, 500.0)
    assert passive.stiffness == 500.0
    assert passive.friction["coulomb_level"] == 30.0
    assert passive.friction["viscous_coefficient"] == pytest.approx(3 * FRICTION["viscous_coefficient"])
    assert passive.friction["coulomb_speed"] == FRICTION["coulomb_speed"]


def test_force_of_a_resting_cable_is_the_elasticas():
    """Pressed by P = EI (2 K(m) / L)^2, with the chord c / L = 2 E(m) / K(m) - 1 (Love 1927, section 263)."""
    tensions: list[float] = []
    start = setting("inspection")
    co_simulate(start, duration=2e-3, step=1e-3, tensions=tensions)
    p = SNARE
    chord = np.hypot(p.ring_distance, np.sqrt(3) * p.ring_radius)
    m = brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - chord / p.cable_length, 1e-6, 0.9)
    force = p.bending_stiffness * (2 * ellipk(m) / p.cable_length) ** 2
    assert tensions[0] == pytest.approx(force, rel=0.01)


def test_cases_of_the_box_stand_at_its_ends():
    study = load_study(INSPECTION)
    points = box_points(study)
    assert points.shape == (study.box_cases, len(study.ranges))
    for i, name in enumerate(study.ranges):
        if name in study.box:
            assert set(np.unique(points[:, i])) == set(study.box[name])
        else:
            assert len(np.unique(points[:, i])) == study.box_cases
    np.testing.assert_allclose(np.unique(np.abs(points[:, 0])), 0.02)


def test_a_capture_plays_as_seen_from_the_end_effector(monkeypatch):
    monkeypatch.setattr(inspection, "DURATION", 0.3)
    done = inspection.simulate({**ARRIVED, "speed": 0.01, "joint_friction": 100.0})
    rows, cables = done.seen()
    assert np.linalg.norm(done.motion.tip[rows[-1], 0] - done.motion.tip[0, 0]) > 1e-3  # the base takes it along
    p = done.snare
    for end, along in ((0, 0.0), (-1, p.ring_distance)):
        np.testing.assert_allclose(cables[:, :, end, 0], along, atol=1e-5)  # the gap of the coupling: 30 µm
        np.testing.assert_allclose(np.hypot(*cables[:, :, end, 1:].T), p.ring_radius, atol=1e-5)
    np.testing.assert_allclose(done.motion.relative[0], FOOT, atol=1e-12)
    page = inspection.film(ARRIVED)
    assert "<script" in page
    assert 'type="range"' in page


def test_the_end_is_judged_after_the_wait(monkeypatch):
    monkeypatch.setattr(inspection, "DURATION", 0.1)
    done = inspection.simulate({**ARRIVED, "wait": 0.05})
    assert done.motion.times[-1] == pytest.approx(0.15, abs=1e-12)
