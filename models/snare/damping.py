"""Damping in bending: a cable loses power as its curvature changes in size, and none as it turns with the ring.

Kelvin's and Voigt's law on κ = |r' × r''|/|r'|², at each of an element's bending points, of weight w:

    P = τ EI w l κ̇²,    f = −τ EI w l κ̇ ∂κ/∂q,    κ̇ = ∂κ/∂q · q̇.

The size of κ is what stays the same in a rigid turn. Its rate as a vector in the world does not: Exudyn's own
`bendingDamping` takes that, and so holds a bent cable back from swinging about its chord. A cable that keeps its
curvature and turns the plane of it, as in a rotary bending test, is not damped here: that needs a material frame,
which a cable without torsion does not have.

Near κ = 0 the size has a kink; √(κ² + ε²) with ε = 0.001/m is damped instead. Only ∂f/∂q̇ is given to Newton's
method: ∂f/∂q is smaller than the stiffness by τ κ̇/κ, and matters to the speed of convergence alone.
"""

from math import sqrt

import numpy as np

from .cubic import combine, first_weights, second_weights
from .energy import BENDING_POINTS, STRAIGHT
from .vector import add_scaled, compiled, cross, dot, scale

TRIPLETS_PER_ELEMENT = 144
"""Written by `add_damping_jacobian`."""


@compiled
def curvature_gradient(element, fraction, size, gradient):
    """Fill ∂√(κ² + ε²)/∂q at ξ of a (4, 3) element, shape (4, 3) [1/m per m; per 1]."""
    n1, n2 = first_weights(fraction, size), second_weights(fraction, size)
    tangent, bow = combine(n1, element), combine(n2, element)
    square = dot(tangent, tangent)
    curvature = scale(1.0 / square, cross(tangent, bow))
    normal = scale(1.0 / sqrt(dot(curvature, curvature) + STRAIGHT * STRAIGHT), curvature)
    by_tangent = add_scaled(cross(bow, normal), -2.0 * dot(normal, curvature), tangent)
    by_bow = cross(normal, tangent)
    for a in range(4):
        for k in range(3):
            gradient[a, k] = (n1[a] * by_tangent[k] + n2[a] * by_bow[k]) / square


@compiled
def add_damping(positions, velocities, n_elements, size, loss, forces):
    """Add f of all cables to the forces on their nodes; `loss` is τ EI [N·m²·s]."""
    gradient = np.empty((4, 3))
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        for i in range(2):
            curvature_gradient(positions[first_row : first_row + 4], BENDING_POINTS[i, 0], size, gradient)
            rate = 0.0
            for a in range(4):
                for k in range(3):
                    rate += gradient[a, k] * velocities[first_row + a, k]
            pull = loss * BENDING_POINTS[i, 1] * size * rate
            for a in range(4):
                for k in range(3):
                    forces[first_row + a, k] -= pull * gradient[a, k]


@compiled
def add_damping_jacobian(positions, n_elements, size, loss, rate_factor, triplets, count):
    """Append the triplets of −rate_factor ∂f/∂q̇; returns the new count."""
    gradients = np.empty((2, 4, 3))
    columns = gradients.reshape(2, 12)
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        for i in range(2):
            curvature_gradient(positions[first_row : first_row + 4], BENDING_POINTS[i, 0], size, gradients[i])
        for row in range(12):
            for column in range(12):
                value = 0.0
                for i in range(2):
                    value += BENDING_POINTS[i, 1] * columns[i, row] * columns[i, column]
                triplets[count, 0] = 3 * first_row + row
                triplets[count, 1] = 3 * first_row + column
                triplets[count, 2] = rate_factor * loss * size * value
                count += 1
    return count
