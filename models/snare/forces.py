"""What Exudyn calls at each iteration, each in one compiled call: all forces that are not its own, and their Jacobian.

`fixed` and `moving` bundle what the compiled functions see: (reference coordinates, elements per cable, their length,
number of the pin's coordinates, its cylinders, constants of the laws, cable radius, stiffness and friction of the
ends, the `line` of a hang point with play), and the arrays that they fill, (pin, Euler parameters and rates, contacts,
crossings, fittings of the ends: see `ends`).
"""

import numpy as np

from .bow import TRIPLETS_PER_ELEMENT as BOW_TRIPLETS
from .bow import add_bow, add_bow_jacobian
from .contact import MOST_CONTACTS, add_pin_contact, contact_force, find_contacts
from .contact_jacobian import add_pin_jacobian, turn_column
from .crossing import MOST_CROSSINGS, add_crossing_jacobian, add_crossings, find_crossings
from .damping import TRIPLETS_PER_ELEMENT, add_damping, add_damping_jacobian
from .ends import (
    REACTION,
    add_bearing_friction,
    add_bearing_jacobian,
    add_end_jacobian,
    add_end_springs,
    end_moment,
)
from .energy import BENDING_LOSS, STRAIN, cable_energies
from .law import DAMPING
from .line import line_pull, line_slope
from .vector import add, compiled, cross, dot, rotate, row, subtract

MOST_TRIPLETS = MOST_CONTACTS * 19 * 19 + MOST_CROSSINGS * 24 * 24 + 54 + 27 + 9
"""Beside those of damping and bow."""


@compiled
def read_pin(coordinates, rates, n_pin, pin, euler):
    """Fill the pin's (6, 3) frame and its Euler parameters from the target's coordinates, where it has some."""
    start = coordinates.size - n_pin
    for k in range(min(n_pin, 3)):
        pin[0, k] = coordinates[start + k]
        pin[1, k] = rates[start + k]
    if n_pin == 7:
        for k in range(4):
            euler[0, k] = coordinates[start + 3 + k]
            euler[1, k] = rates[start + 3 + k]
        a, b, c, d = euler[0]
        pin[3, 0], pin[3, 1], pin[3, 2] = 1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)
        pin[4, 0], pin[4, 1], pin[4, 2] = 2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)
        pin[5, 0], pin[5, 1], pin[5, 2] = 2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)
        for i in range(3):
            pin[2, i] = 0.0
        for k in range(4):
            column = turn_column(euler[0], k)
            for i in range(3):
                pin[2, i] += column[i] * euler[1, k]


@compiled
def read_state(q, rates, fixed, moving):
    """The cables' nodes and their velocities, each (rows, 3), at displacements q and rates; the pin is read too."""
    reference, n_pin = fixed[0], fixed[3]
    coordinates = q + reference
    read_pin(coordinates, rates, n_pin, moving[0], moving[1])
    n_cables = q.size - n_pin
    return coordinates[:n_cables].reshape(-1, 3), rates[:n_cables].reshape(-1, 3)


@compiled
def system_forces(q, rates, fixed, moving):
    """Generalised forces on all coordinates, shape (n_coordinates,), at displacements q and rates."""
    _, n_elements, size, n_pin, cylinders, law, radius, stiffness, friction, line = fixed
    pin, euler, contacts, crossings, fittings = moving
    positions, velocities = read_state(q, rates, fixed, moving)
    result, n_cables = np.zeros(q.size), positions.size
    forces = result[:n_cables].reshape(-1, 3)
    push, moment = add_pin_contact(
        positions, velocities, n_elements, size, cylinders, pin, law, radius, contacts, forces
    )
    add_crossings(positions, velocities, n_elements, size, law, radius, crossings, forces)
    if stiffness > 0.0:
        add_end_springs(positions, n_elements, stiffness, fittings, forces)
    add_bearing_friction(positions, velocities, n_elements, friction, fittings, forces)
    add_bow(positions, n_elements, size, law, forces)
    add_damping(positions, velocities, n_elements, size, law[DAMPING], forces)
    if line[0] > 0.0:
        arm = rotate(pin[3:6], (line[9], line[10], line[11]))
        pull, _, _ = line_pull(line, add(row(pin, 0), arm), add(row(pin, 1), cross(row(pin, 2), arm)))
        push, moment = add(push, pull), add(moment, cross(arm, pull))
    for k in range(min(n_pin, 3)):
        result[n_cables + k] = push[k]
    if n_pin == 7:
        for k in range(4):
            result[n_cables + 3 + k] = dot(turn_column(euler[0], k), moment)
    return result


@compiled
def system_jacobian(q, rates, fixed, moving, factor, rate_factor):
    """Triplets (row, column, value) of −(factor ∂f/∂q + rate_factor ∂f/∂q̇), shape (n_triplets, 3)."""
    _, n_elements, size, n_pin, cylinders, law, radius, stiffness, friction, line = fixed
    pin, euler, contacts, crossings, fittings = moving
    positions, velocities = read_state(q, rates, fixed, moving)
    n_all = positions.shape[0] // 2 // (n_elements + 1) * n_elements
    triplets = np.empty((MOST_TRIPLETS + n_all * (TRIPLETS_PER_ELEMENT + BOW_TRIPLETS), 3))
    factors = (factor, rate_factor)
    count = find_contacts(positions, n_elements, size, cylinders, pin, law, radius, contacts)
    count = add_pin_jacobian(
        positions, velocities, size, cylinders, pin, law, contacts, count, euler, n_pin, factors, triplets
    )
    n_crossings = find_crossings(positions, n_elements, size, radius, crossings)
    count = add_crossing_jacobian(positions, velocities, size, law, crossings, n_crossings, factors, triplets, count)
    if stiffness > 0.0:
        count = add_end_jacobian(positions, n_elements, stiffness, fittings, factor, triplets, count)
    if factor != 0.0:
        count = add_bow_jacobian(positions, n_elements, size, law, factor, triplets, count)
    if rate_factor != 0.0:
        count = add_bearing_jacobian(positions, n_elements, friction, rate_factor, triplets, count)
        count = add_damping_jacobian(positions, n_elements, size, law[DAMPING], rate_factor, triplets, count)
    if line[0] > 0.0:
        count = _add_line_jacobian(q.size - n_pin, pin, line, factors, triplets, count)
    return triplets[:count].copy()


@compiled
def _add_line_jacobian(first, pin, line, factors, triplets, count):
    """Append those for the target's position; what its turning changes matters to no result."""
    slopes = np.empty((3, 3))
    arm = rotate(pin[3:6], (line[9], line[10], line[11]))
    point, velocity = add(row(pin, 0), arm), add(row(pin, 1), cross(row(pin, 2), arm))
    line_slope(line, point, velocity, slopes)
    _, _, longer = line_pull(line, point, velocity)
    for i in range(3):
        for k in range(3):
            triplets[count, 0] = first + i
            triplets[count, 1] = first + k
            triplets[count, 2] = -factors[0] * slopes[i, k] + factors[1] * line[12] * longer[i] * longer[k]
            count += 1
    return count


@compiled
def measure(q, rates, fixed, moving, section, pull, ends, effector, ring_spin):
    """Read a state after a step.

    `pull` is the force of the cables on the rings at the six `ends`; `effector` is the end effector's frame,
    `ring_spin` the rotating ring's angular velocity in the world.

    Returns
    -------
    array (12,)
        Force and moment on the pin about its foot, on the end effector about its origin.
    array (7,)
        `cable_energies`.
    array (n_contacts, 6)
        Contact points on the pin, and forces on the cable there.
    float
        Power of the rings' moments on the cables [W]; their forces' work follows from where the ends go.
    """
    _, n_elements, size, _, cylinders, law, radius, stiffness, friction, _ = fixed
    pin, _, contacts, crossings, fittings = moving
    positions, velocities = read_state(q, rates, fixed, moving)
    count = find_contacts(positions, n_elements, size, cylinders, pin, law, radius, contacts)
    n_crossings = find_crossings(positions, n_elements, size, radius, crossings)
    touching, within = np.zeros((count, 6)), np.empty((4, 3))
    wrench = np.zeros(12)
    for index in range(count):
        push, point, _, _, couple = contact_force(
            positions, velocities, size, cylinders, pin, law, contacts[index], within
        )
        turn = subtract(cross(subtract(point, row(pin, 0)), push), couple)
        for k in range(3):
            touching[index, k] = point[k]
            touching[index, 3 + k] = push[k]
            wrench[k] -= push[k]
            wrench[3 + k] -= turn[k]
    power = 0.0
    for end in range(6):
        turn = cross(subtract(row(ends, end), row(effector, 0)), row(pull, end))
        moment = end_moment(positions, n_elements, stiffness, fittings, end)
        power -= dot(moment, row(effector, 2) if end % 2 == 0 else ring_spin)
        for k in range(3):
            wrench[6 + k] += pull[end, k]
            wrench[9 + k] += turn[k] + moment[k]
    energies = cable_energies(
        positions, velocities, n_elements, size, section, cylinders, pin, law, contacts, count, crossings, n_crossings
    )
    energies[BENDING_LOSS] += add_bearing_friction(
        positions, velocities, n_elements, friction, fittings, np.zeros_like(positions)
    )
    power -= dot(row(fittings, REACTION), row(effector, 2))
    for k in range(3):
        wrench[9 + k] += fittings[REACTION, k]
    if stiffness > 0.0:
        energies[STRAIN] += add_end_springs(positions, n_elements, stiffness, fittings, np.zeros_like(positions))
    return wrench, energies, touching, power
