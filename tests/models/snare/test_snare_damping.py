"""Damping in bending: nothing in a rigid motion, the closed form of an arc that opens, and its Jacobian."""

# pyright: reportArgumentType=false

import numpy as np
import pytest

from snarelab.models.snare.damping import TRIPLETS_PER_ELEMENT, add_damping, add_damping_jacobian
from snarelab.models.snare.energy import BENDING_LOSS, cable_energies
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled

P = SnareParameters()
N = 10
LENGTH, SIZE = P.cable_length, P.cable_length / N
LOSS = P.bending_damping * P.bending_stiffness


def damping(positions, velocities):
    forces = np.zeros_like(positions)
    add_damping(positions, velocities, N, SIZE, LOSS, forces)
    return forces


def cables():
    return settled(P, N).reshape(-1, 3).copy()


def opening_arc(radius, rate):
    """Nodes of a circle's arc of fixed length whose radius grows at a rate [m/s], and their velocities."""
    s = np.linspace(0, LENGTH, N + 1)
    sine, cosine, turn = np.sin(s / radius), np.cos(s / radius), s / radius
    none = np.zeros_like(s)
    positions = np.stack([radius * sine, radius * (1 - cosine), none, cosine, sine, none], axis=1)
    by_radius = [sine - turn * cosine, 1 - cosine - turn * sine, none, turn / radius * sine, -turn / radius * cosine]
    return positions.reshape(-1, 3), rate * np.stack([*by_radius, none], axis=1).reshape(-1, 3)


def rigid(positions, velocity, spin, about):
    """Velocities of a rigid motion; slopes turn only."""
    moving = np.cross(spin, positions)
    moving[0::2] += velocity - np.cross(spin, about)
    return moving


def test_a_bent_cable_swings_about_its_chord_without_a_brake():
    positions = cables()
    first, last = positions[0], positions[2 * N]
    chord = (last - first) / np.linalg.norm(last - first)
    swing = rigid(positions, np.zeros(3), 10.0 * chord, first)
    # the rate of the world's curvature vector would lose τ EI ∫(10/s κ)² ds: 0.4 W
    assert -np.sum(damping(positions, swing) * swing) < 1e-12
    assert np.max(np.abs(damping(positions, swing))) < 1e-9
    rng = np.random.default_rng(2)
    motion = rigid(positions, rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
    assert np.max(np.abs(damping(positions, motion))) < 1e-9
    bending = rng.normal(size=positions.shape)
    assert np.max(np.abs(damping(positions, bending))) > 1.0  # so that the zeros above say something


@pytest.mark.parametrize("radius", [0.1, 0.15, 0.6])
def test_an_arc_that_opens_loses_the_power_of_its_curvature_rate(radius):
    positions, velocities = opening_arc(radius, 0.03)
    power = -np.sum(damping(positions, velocities) * velocities)
    # κ = 1/R, κ̇ = −Ṙ/R²; cubics follow an arc to (l/R)⁴/100 or so
    assert power == pytest.approx(LOSS * LENGTH * (0.03 / radius**2) ** 2, rel=2e-4)


def test_damping_balances_force_and_moment_and_is_what_energy_counts():
    positions = cables()
    velocities = np.random.default_rng(4).normal(size=positions.shape)
    forces = damping(positions, velocities)
    assert np.abs(forces[0::2].sum(axis=0)).max() < 1e-12 * np.abs(forces).sum()
    assert np.abs(np.cross(positions, forces).sum(axis=0)).max() < 1e-12 * np.abs(forces).sum()
    section = np.array([P.mass_per_length, P.axial_stiffness, P.bending_stiffness, 0.0, P.bending_damping, 0.0])
    none = np.zeros((0, 5))
    lost = cable_energies(
        positions, velocities, N, SIZE, section, np.zeros((2, 3)), np.zeros((6, 3)), np.zeros(6), none, 0, none, 0
    )[BENDING_LOSS]
    assert lost == pytest.approx(-np.sum(forces * velocities), rel=1e-12)


def test_jacobian_is_the_derivative_by_rates():
    """The force is linear in the rates: differences of any size are exact."""
    positions = cables()
    triplets = np.zeros((3 * N * TRIPLETS_PER_ELEMENT, 3))
    assert add_damping_jacobian(positions, N, SIZE, LOSS, 2.0, triplets, 0) == len(triplets)
    exact = np.zeros((positions.size, positions.size))
    np.add.at(exact, (triplets[:, 0].astype(int), triplets[:, 1].astype(int)), triplets[:, 2])
    found = [damping(positions, step.reshape(-1, 3)).ravel() for step in np.eye(positions.size)]
    assert np.allclose(exact, -2.0 * np.array(found).T, rtol=1e-9, atol=1e-12 * np.abs(exact).max())


def test_a_straight_cable_is_no_trouble():
    positions, velocities = opening_arc(1e9, 0.0)
    forces = damping(positions, np.random.default_rng(5).normal(size=velocities.shape))
    assert np.all(np.isfinite(forces))
