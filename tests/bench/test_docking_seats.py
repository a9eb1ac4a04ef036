"""Seats beside MuJoCo: its own contact forces, summed, against Newton; and a touch in flight."""

import numpy as np
import pytest

from bench.docking_mujoco import Truth
from bench.docking_seats import AFTER, FORCE, INERTIA, MASS, SPEED, P, Pushed, damping_ratio, flight, push, start
from snarelab.models.docking.body import DockingBody


def test_mujocos_contact_forces_are_what_its_momentum_lacks():
    _, place, turn = start(np.random.default_rng(3))
    truth = Truth(friction=0.2, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness, damping=1.0)
    found = push(truth, FORCE, 0.6, place, turn)
    velocity = (found.place[-1] - found.place[-2]) / 1e-4
    np.testing.assert_allclose(found.impulse[-1], MASS * velocity - [FORCE * 0.6, 0, 0], atol=0.02)
    assert np.linalg.norm(found.impulse[-1]) > 3.0


def test_a_touch_in_flight_is_alike_and_hangs_on_the_flanks_angle():
    body = DockingBody(MASS, INERTIA, 1e-6)
    _, place, turn = start(np.random.default_rng(1))
    truth = Truth(friction=0.15, mass=MASS, inertia=INERTIA, edge=P.edge, stiffness=P.stiffness)
    ours, theirs = (x.impulse_after(AFTER[0]) for x in flight(body, P, truth, place, turn))
    assert np.linalg.norm(ours) > 0.5 * MASS * SPEED
    assert np.linalg.norm(ours - theirs) < 0.05 * np.linalg.norm(ours)
    steep = P.with_values(flank=np.deg2rad(35.0))
    other = flight(body, steep, truth, place, turn)[0].impulse_after(AFTER[0])
    assert np.linalg.norm(other - theirs) > 0.05 * np.linalg.norm(ours)


@pytest.mark.parametrize("restitution", [0.25, 0.3, 0.9])
def test_a_linear_contact_keeps_what_it_is_told_to(restitution):
    """m x'' = -k x - c x', until it would pull; by small steps."""
    ratio, x, v, h = damping_ratio(restitution), 0.0, 1.0, 1e-5
    while (push := -x - 2 * ratio * v) < 0 or x == 0.0:
        v += h * push
        x += h * v
    assert -v == pytest.approx(restitution, abs=2e-3)


def test_an_impulse_counts_from_the_first_touch():
    time = np.arange(0.0, 1.0, 0.1)
    impulse = np.outer(np.where(time > 0.35, time, 0.0), [1.0, 0.0, 0.0])
    pushed = Pushed(time, np.zeros((10, 3)), np.zeros((10, 4)), impulse, np.zeros(10))
    np.testing.assert_allclose(pushed.impulse_after(0.3), [0.7, 0, 0])


def test_what_still_moves_does_not_rest():
    time = np.linspace(0.0, 2.0, 2001)
    for speed, rests in ((1e-6, True), (1e-3, False)):
        place = np.outer(time, [0.0, speed, 0.0])
        assert Pushed(time, place, np.zeros((2001, 4)), place, np.zeros(2001)).rests == rests
