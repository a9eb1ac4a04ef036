"""Where the ring's work goes: strain, motion, the overlap of contacts, and what damping and friction take.

Strain is integrated at the points that the ANCF element uses itself (Lobatto's three for tension, Gauss's two for
bending, Exudyn's reduced rule 2), so that a balance shows the time integrator's own error and nothing else.
"""

import numpy as np

from .bow import bow_energy
from .contact import contact_force
from .crossing import crossing_force, crossing_give
from .cubic import MASS_POINTS, combine, first_weights, second_weights, weights
from .law import powers
from .vector import add, compiled, cross, dot, length, scale, subtract

STRAIN, KINETIC, OVERLAP, BENDING_LOSS, AXIAL_LOSS, CONTACT_LOSS, FRICTION_LOSS = range(7)
"""Entries of `cable_energies`: three energies [J], then four powers lost [W]."""

TENSION_POINTS = np.array([[0.0, 1 / 6], [0.5, 4 / 6], [1.0, 1 / 6]])
BENDING_POINTS = np.array([[0.5 - np.sqrt(1 / 12), 0.5], [0.5 + np.sqrt(1 / 12), 0.5]])
"""ξ and weight where an element's tension and bending are integrated."""
STRAIGHT = 1e-3
"""Curvature below which a cable counts as straight [1/m]: its size has no rate there, see `damping`."""


@compiled
def cable_energies(
    positions, velocities, n_elements, size, section, cylinders, pin, law, contacts, n_contacts, crossings, n_crossings
):
    """Energies and losses of all cables, shape (7,), in the order above.

    `section`: ρA, EA, EI, the stiffness-proportional damping of tension and of bending [s], and the prestrain.
    """
    result = np.zeros(7)
    within = np.empty((4, 3))
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        element = positions[first_row : first_row + 4]
        rates = velocities[first_row : first_row + 4]
        result[STRAIN] += bow_energy(law, element, size)
        for i in range(3):
            n1 = first_weights(TENSION_POINTS[i, 0], size)
            share = TENSION_POINTS[i, 1] * size * section[1]
            tangent, tangent_rate = combine(n1, element), combine(n1, rates)
            stretch = length(tangent)
            result[STRAIN] += 0.5 * share * (stretch - 1.0 + section[5]) ** 2
            result[AXIAL_LOSS] += share * section[3] * (dot(tangent, tangent_rate) / stretch) ** 2
        for i in range(2):
            n1, n2 = first_weights(BENDING_POINTS[i, 0], size), second_weights(BENDING_POINTS[i, 0], size)
            share = BENDING_POINTS[i, 1] * size * section[2]
            tangent, bow = combine(n1, element), combine(n2, element)
            tangent_rate, bow_rate = combine(n1, rates), combine(n2, rates)
            square = dot(tangent, tangent)
            curvature = scale(1.0 / square, cross(tangent, bow))
            turned = add(cross(tangent_rate, bow), cross(tangent, bow_rate))
            rate = subtract(scale(1.0 / square, turned), scale(2.0 * dot(tangent, tangent_rate) / square, curvature))
            bent = dot(curvature, curvature)
            result[STRAIN] += 0.5 * share * bent
            result[BENDING_LOSS] += share * section[4] * dot(curvature, rate) ** 2 / (bent + STRAIGHT * STRAIGHT)
        for i in range(4):
            speed = combine(weights(MASS_POINTS[i, 0], size), rates)
            result[KINETIC] += 0.5 * MASS_POINTS[i, 1] * size * section[0] * dot(speed, speed)
    for index in range(n_contacts):
        _, _, normal, speed, _ = contact_force(
            positions, velocities, size, cylinders, pin, law, contacts[index], within
        )
        stored, damped, rubbed = powers(law, contacts[index, 3], contacts[index, 4], normal, speed)
        result[OVERLAP] += stored
        result[CONTACT_LOSS] += damped
        result[FRICTION_LOSS] += rubbed
    for index in range(n_crossings):
        _, normal, _, speed = crossing_force(positions, velocities, size, law, crossings[index])
        soft = crossing_give(law, crossings[index], size)
        stored, damped, rubbed = powers(law, crossings[index, 4], soft, normal, speed)
        result[OVERLAP] += stored
        result[CONTACT_LOSS] += damped
        result[FRICTION_LOSS] += rubbed
    return result
