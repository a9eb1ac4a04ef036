"""The penalty contact of the rods that captures are recorded with: Hertz, Zener's damping, a friction that sticks."""

import numpy as np
import pytest

from bench.snare_rods import BEHIND, STICK, _push

X = np.array([1.0, 0.0, 0.0])
REACH, HERTZ, MU, STEP = 0.0095, 1e6, 0.2, 1e-4
LOW = 4e-4
"""[m] How far the cable is inside the pin."""


def touch(held, *, at=0.003, velocity=(0.0, 0.0, 0.0), damping=0.0, low=LOW):
    """A straight cable along y over a pin along −x, a joint at ``at``: forces and moments on rods, force on the pin."""
    y = at + 0.01 * np.arange(-2.0, 3.0)
    joints = np.stack([0 * y - 0.1, y, 0 * y + REACH - low], 1)[None]
    n = joints.shape[1] - 1
    twists = np.zeros((n, 6))
    twists[:, 3:] = velocity
    centres = 0.5 * (joints[0, 1:] + joints[0, :-1])
    numbers = np.array([REACH, HERTZ, damping, MU, 0.26, STEP])
    return _push(joints, centres, twists, np.zeros((n, 3)), np.zeros(3), np.zeros(3), X, numbers, held)


def nothing():
    return np.full((1, 4, 4), np.nan)


NORMAL = HERTZ * LOW**1.5


def test_the_overlap_pushes_by_hertz_and_what_the_rod_feels_the_pin_feels_back():
    forces, moments, pin = touch(nothing())
    assert forces.sum(0) == pytest.approx([0, 0, NORMAL])
    assert pin == pytest.approx(-forces.sum(0))
    (rod,) = np.flatnonzero(forces.any(1))
    assert rod == 1  # from −7 to 3 mm, the only one above the axis
    assert moments[rod] == pytest.approx(np.cross([0, 0.002, 0], forces[rod]))  # its centre is 2 mm aside


def test_a_cable_beyond_the_tip_or_out_of_reach_is_not_touched():
    assert not touch(nothing(), low=-1e-6)[0].any()


def test_a_contact_sticks_on_its_spring_and_slips_at_coulombs_limit():
    held, slow = nothing(), (0.01, 0.0, 0.0)
    for k in range(1, 6):
        forces, _, _ = touch(held, velocity=slow)
        assert forces[:, 0].sum() == pytest.approx(-STICK * k * 0.01 * STEP)
    forces, _, _ = touch(held)  # and holds it at rest
    assert forces[:, 0].sum() == pytest.approx(-STICK * 5 * 0.01 * STEP)
    for _ in range(100):
        forces, _, _ = touch(held, velocity=(0.3, 0.0, 0.0))
    assert forces.sum(0) == pytest.approx([-MU * NORMAL, 0, NORMAL])


def test_a_contact_that_moves_to_the_next_rod_keeps_its_spring():
    held = nothing()
    before, _, _ = touch(held, at=0.0001, velocity=(0.05, 0.0, 0.0))
    after, _, _ = touch(held, at=-0.0001)
    assert np.flatnonzero(before.any(1)) != np.flatnonzero(after.any(1))
    assert after.sum(0) == pytest.approx(before.sum(0))
    touch(held, low=-1e-6)  # apart: all is forgotten
    assert touch(held)[0][:, 0].sum() == 0.0


def test_the_damper_behind_its_spring_reaches_its_own_force_and_never_pulls():
    held, damping = nothing(), 300.0
    found = [touch(held, velocity=(0.0, 0.0, -0.01), damping=damping)[0][:, 2].sum() for _ in range(400)]
    grown = damping * 0.01 * (1 - np.exp(-BEHIND * STEP / damping * np.arange(1, 401)))
    assert found == pytest.approx(NORMAL + grown)
    assert found[-1] == pytest.approx(NORMAL + damping * 0.01)
    for _ in range(400):
        forces, _, _ = touch(held, velocity=(0.0, 0.0, 0.1), damping=damping)
    assert forces[:, 2].sum() == 0.0
