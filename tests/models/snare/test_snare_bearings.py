"""Friction of the bearings that hold the cables on the fixed ring: closed forms, and its Jacobian."""

# pyright: reportArgumentType=false

import numpy as np
import pytest

from snarelab.models.snare.ends import REACTION, RING_SPIN, add_bearing_friction, add_bearing_jacobian
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled

P = SnareParameters()
N = 10
ROWS = 2 * (N + 1)


def friction(positions, velocities, ring_spin=(0.0, 0.0, 0.0)):
    """Forces (rows, 3), moment on the bearings, power lost."""
    forces, fittings = np.zeros_like(positions), np.zeros((8, 3))
    fittings[RING_SPIN] = ring_spin
    lost = add_bearing_friction(positions, velocities, N, P.end_friction, fittings, forces)
    return forces, fittings[REACTION], lost


def test_a_swing_about_the_chord_loses_what_tilts_the_end():
    positions = settled(P, N).reshape(-1, 3).copy()
    velocities = np.zeros_like(positions)
    first, last = positions[0], positions[ROWS - 2]
    swing = 3.0 * (last - first) / np.linalg.norm(last - first)
    velocities[:ROWS] = np.cross(swing, positions[:ROWS])
    velocities[0:ROWS:2] -= np.cross(swing, first)
    forces, reaction, lost = friction(positions, velocities)
    tangent = positions[1] / np.linalg.norm(positions[1])
    tilt = swing - (swing @ tangent) * tangent
    assert lost == pytest.approx(P.end_friction * tilt @ tilt)
    assert -np.sum(forces * velocities) == pytest.approx(lost)
    np.testing.assert_allclose(reaction, P.end_friction * tilt)


def test_a_ring_that_turns_with_its_cables_meets_none():
    positions, spin = settled(P, N).reshape(-1, 3).copy(), np.array([0.3, -0.2, 0.5])
    forces, reaction, lost = friction(positions, np.cross(spin, positions), spin)
    assert max(np.abs(forces).max(), np.abs(reaction).max(), lost) < 1e-15


def test_force_and_moment_balance_and_power_is_lost():
    rng, positions, spin = np.random.default_rng(1), settled(P, N).reshape(-1, 3).copy(), np.array([0.3, -0.2, 0.5])
    velocities = rng.normal(size=positions.shape)
    forces, reaction, lost = friction(positions, velocities, spin)
    np.testing.assert_allclose(np.cross(positions, forces).sum(axis=0), -reaction, atol=1e-15)
    assert -np.sum(forces * velocities) - reaction @ spin == pytest.approx(lost)


def test_jacobian_is_the_derivative_by_rates():
    """The force is linear in the rates: differences of any size are exact."""
    positions = settled(P, N).reshape(-1, 3).copy()
    triplets = np.zeros((27, 3))
    assert add_bearing_jacobian(positions, N, P.end_friction, 2.0, triplets, 0) == 27
    exact = np.zeros((positions.size, positions.size))
    np.add.at(exact, (triplets[:, 0].astype(int), triplets[:, 1].astype(int)), triplets[:, 2])
    found = [friction(positions, step.reshape(-1, 3))[0].ravel() for step in np.eye(positions.size)]
    np.testing.assert_allclose(exact, -2.0 * np.array(found).T, atol=1e-15)
