"""Springs at the cable ends, where a fitting holds their direction: V = k (1 − t · t₀) ≈ k θ²/2.

t is the cable's tangent at the end, t₀ the direction at rest, which turns with its ring. Without them (k = 0, spherical
joints as in the paper) a cable may swing about its chord.
"""

import numpy as np

from .vector import compiled, cross, dot, length, row, scale


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
