"""The cable ends: spherical bearings with viscous friction, and springs where a fitting holds their direction.

t is the cable's tangent at the end, t₀ its direction at rest, Ω the angular velocity of the ring, with which t₀ turns.
A spring stores V = k (1 − t · t₀) ≈ k θ²/2. A bearing's moment on the cable is −c (t × ṫ − Ω⊥), c its friction, Ω⊥ what
of Ω lies across t: turning about itself the cable meets none, for the element has no such rotation. Springs are left
out by default (the paper has spherical joints). Bearings on the fixed ring have friction, those on the rotating ring
run freely; friction there is what ends the cable's swing about its chord, which no damping inside a cable can.
"""

import numpy as np

from .vector import add_scaled, compiled, cross, dot, length, row, scale, subtract

RING_SPIN, REACTION = 6, 7
"""Rows of the fittings, shape (8, 3): after the rest directions of the six ends the fixed ring's angular velocity
[rad/s], and, filled here, the moment of all cables on their bearings [N·m]."""


@compiled
def end_rows(n_elements):
    """Rows of r' at the six ends: cable 0 on the fixed ring, on the rotating one, cable 1, and so on."""
    rows = np.empty(6, dtype=np.int64)
    for end in range(6):
        rows[end] = 2 * ((end // 2) * (n_elements + 1) + (end % 2) * n_elements) + 1
    return rows


@compiled
def add_end_springs(positions, n_elements, stiffness, directions, forces):
    """Add k (t₀ − (t · t₀) t)/|r'| to the forces on r' at each end; returns the energy stored [J]."""
    energy = 0.0
    rows = end_rows(n_elements)
    for end in range(6):
        slope, rest = row(positions, rows[end]), row(directions, end)
        size = length(slope)
        share = dot(slope, rest) / size
        energy += stiffness * (1.0 - share)
        for k in range(3):
            forces[rows[end], k] += stiffness * (rest[k] - share * slope[k] / size) / size
    return energy


@compiled
def end_moment(positions, n_elements, stiffness, directions, end):
    """Moment of the cable on its ring at an end [N·m]: −k t × t₀."""
    slope = row(positions, end_rows(n_elements)[end])
    return scale(-stiffness / length(slope), cross(slope, row(directions, end)))


@compiled
def add_end_jacobian(positions, n_elements, stiffness, directions, factor, triplets, count):
    """Append the triplets of −factor ∂f/∂q; returns the new count."""
    rows = end_rows(n_elements)
    for end in range(6):
        slope, rest = row(positions, rows[end]), row(directions, end)
        square = dot(slope, slope)
        cube = square * length(slope)
        share = dot(slope, rest)
        for i in range(3):
            for j in range(3):
                value = -rest[i] * slope[j] - slope[i] * rest[j] + 3 * share * slope[i] * slope[j] / square
                if i == j:
                    value -= share
                if value != 0.0:
                    triplets[count, 0] = 3 * rows[end] + i
                    triplets[count, 1] = 3 * rows[end] + j
                    triplets[count, 2] = -factor * stiffness * value / cube
                    count += 1
    return count


@compiled
def add_bearing_friction(positions, velocities, n_elements, friction, fittings, forces):
    """Add the friction of the bearings, c in N·m·s/rad, to the forces on r'; returns the power lost [W]."""
    rows, lost = end_rows(n_elements), 0.0
    for k in range(3):
        fittings[REACTION, k] = 0.0
    for end in (0, 2, 4):
        slope, spin = row(positions, rows[end]), row(fittings, RING_SPIN)
        square = dot(slope, slope)
        turning = scale(1.0 / square, cross(slope, row(velocities, rows[end])))
        rate = subtract(turning, add_scaled(spin, -dot(spin, slope) / square, slope))
        force = scale(-friction / square, cross(rate, slope))
        lost += friction * dot(rate, rate)
        for k in range(3):
            forces[rows[end], k] += force[k]
            fittings[REACTION, k] += friction * rate[k]
    return lost


@compiled
def add_bearing_jacobian(positions, n_elements, friction, rate_factor, triplets, count):
    """Append the triplets of −rate_factor ∂f/∂q̇ = rate_factor c (1 − t tᵀ)/|r'|²; returns the new count.

    ∂f/∂q is left out: it is of the size of the friction's moment, small beside what bends the cable.
    """
    rows = end_rows(n_elements)
    for end in (0, 2, 4):
        slope = row(positions, rows[end])
        square = dot(slope, slope)
        for i in range(3):
            for j in range(3):
                triplets[count, 0] = 3 * rows[end] + i
                triplets[count, 1] = 3 * rows[end] + j
                triplets[count, 2] = rate_factor * friction / square * ((i == j) - slope[i] * slope[j] / square)
                count += 1
    return count
