"""Jacobian of the contact with the pin: the closest point moves with the coordinates.

Differentiating h + ½ e' f = 0 gives ∂s/∂q = −(h + ½ e' f)_q/(h + ½ e' f)_s. A column is the first-order change of all
forces with one coordinate (factor `position_factor`) and with its rate (`velocity_factor`), written as triplets (row,
column, value) of −∂f/∂q, which is Exudyn's left-hand side. It is exact but for second derivatives of the bow (`bow`),
under a hundredth of its largest entry in a soft capture, two under the 5 kN of a preload.
"""

import numpy as np

from .bow import give_change
from .contact import contact_force, slope_change
from .cubic import combine, first_weights, second_weights, weights
from .law import force_change, hertz_push
from .pin import surface
from .vector import add, add_scaled, compiled, cross, dot, rotate, rotate_back, row, scale, subtract, unit

_ZERO = (0.0, 0.0, 0.0)


@compiled
def turn_column(euler, index):
    """Column of G: ω = G(e) ė, e the Euler parameters (Nikravesh 1988)."""
    a, b, c, d = 2 * euler[0], 2 * euler[1], 2 * euler[2], 2 * euler[3]
    if index == 0:
        return (-b, -c, -d)
    if index == 1:
        return (a, d, -c)
    if index == 2:
        return (-d, a, b)
    return (c, -b, a)


@compiled
def _write(triplets, count, line, column, value):
    if value != 0.0 and count < triplets.shape[0]:
        triplets[count, 0] = line
        triplets[count, 1] = column
        triplets[count, 2] = value
        count += 1
    return count


@compiled
def add_pin_jacobian(
    positions, velocities, size, cylinders, pin, law, contacts, n_contacts, euler, n_pin, factors, triplets
):
    """Write the triplets of all listed contacts; returns how many.

    `euler` is (2, 4), Euler parameters and their rates; the pin's `n_pin` coordinates, 0, 3 (position) or 7 (and Euler
    parameters), follow the cables'. `factors` are those of positions and velocities.
    """
    count = 0
    within = np.empty((4, 3))
    pin_column = 3 * positions.shape[0]
    spin = row(pin, 2)
    for index in range(n_contacts):
        first_row, part, s = int(contacts[index, 0]), int(contacts[index, 1]), contacts[index, 2]
        gap = contacts[index, 3]
        element = positions[first_row : first_row + 4]
        push, point, normal, w, _ = contact_force(
            positions, velocities, size, cylinders, pin, law, contacts[index], within
        )
        arm = subtract(point, row(pin, 0))
        n, n1 = weights(s, size), first_weights(s, size)
        tangent = combine(n1, element)
        bow = combine(second_weights(s, size), element)
        _, _, bend, across, roundness, around = surface(cylinders[part], rotate_back(pin[3:6], arm))
        across, around = rotate(pin[3:6], across), rotate(pin[3:6], around)
        curvature = bend * dot(across, tangent) ** 2 + roundness * dot(around, tangent) ** 2 + dot(normal, bow)
        along = add(scale(bend * dot(across, tangent), across), scale(roundness * dot(around, tangent), around))  # H r'
        soft, soft_along = contacts[index, 4], give_change(law, s, size)
        size_of, stiff = hertz_push(law, gap, soft)
        curvature = slope_change(law, s, size, curvature, size_of, stiff)
        rate_along = subtract(combine(n1, velocities[first_row : first_row + 4]), cross(spin, tangent))
        for j in range(12 + n_pin):
            node_vector, axis = j // 3, j % 3
            moved = tangent_change = turn = w_change = shift = _ZERO
            if j < 12:
                moved = scale(n[node_vector], unit(axis))
                tangent_change = scale(n1[node_vector], unit(axis))
                shift = w_rate = moved
                column = 3 * first_row + j
            else:
                column = pin_column + j - 12
                if j < 15:
                    moved = scale(-1.0, unit(axis))
                    shift = w_rate = moved
                else:
                    turn = turn_column(euler[0], j - 15)
                    shift = w_rate = cross(arm, turn)
                    w_change = cross(turn_column(euler[1], j - 15), arm)
            # moved: of the arm in the world; shift: of the point as the pin sees it
            w_change = subtract(w_change, cross(spin, moved))
            n_change = add(
                add(scale(bend * dot(across, shift), across), scale(roundness * dot(around, shift), around)),
                cross(turn, normal),
            )
            gap_change = dot(normal, shift)
            if j < 12:
                gap_change += within[node_vector, axis]
            s_change = dot(tangent_change, normal) + dot(tangent, n_change) - 0.5 * soft_along * stiff * gap_change
            s_change /= -curvature
            n_change = add_scaled(n_change, s_change, along)
            w_change = add_scaled(w_change, s_change, rate_along)
            soft_change = soft_along * s_change
            gap_change -= 0.5 * size_of * soft_change  # where the energy is least, h is −½ e' f
            still = force_change(law, gap, soft, normal, w, gap_change, soft_change, n_change, w_change)
            moving = force_change(law, gap, soft, normal, w, 0.0, 0.0, _ZERO, w_rate)
            change = add(scale(factors[0], still), scale(factors[1], moving))
            for a in range(4):
                value = add_scaled(scale(n[a], change), factors[0] * n1[a] * s_change, push)
                for k in range(3):
                    full = value[k] + within[a, k] * dot(change, normal)
                    count = _write(triplets, count, 3 * (first_row + a) + k, column, -full)
            if n_pin > 0:
                for k in range(3):
                    count = _write(triplets, count, pin_column + k, column, change[k])
            if n_pin == 7:
                arm_change = add_scaled(moved, s_change, tangent)
                moment_change = add(scale(factors[0], cross(arm_change, push)), cross(arm, change))
                for k in range(4):
                    value_k = dot(turn_column(euler[0], k), moment_change)
                    if j >= 15:
                        value_k += factors[0] * dot(_second_turn(j - 15, k), cross(arm, push))
                    count = _write(triplets, count, pin_column + 3 + k, column, value_k)
    return count


@compiled
def _second_turn(changed, index):
    """Column `index` of G for the unit Euler parameter `changed`: ∂G/∂e."""
    e = (
        1.0 if changed == 0 else 0.0,
        1.0 if changed == 1 else 0.0,
        1.0 if changed == 2 else 0.0,
        1.0 if changed == 3 else 0.0,
    )
    return turn_column(e, index)
