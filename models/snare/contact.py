"""Contact of the cables with the pin, continuous along the cable: where they touch, and the forces there.

On the cubic r(s) of a cable, the distance φ to a cylinder of the pin is least where h(s) = n · r'(s) changes from
negative to positive; each such point with φ below the cable's radius carries one contact. (Points at fixed stations
along the cable would act as bumps.) Between its nodes a cubic is not where the cable is; `bow` says by how much, and
point and gap are corrected for that. The force F acts on the cable at r(s), as N_a(s) F on coordinate a of the element,
and −F on the pin at the same point, so that momentum, angular momentum and power balance exactly.

A state is two (n_rows, 3) arrays, positions and velocities; each node has two rows, r and r'. The pin is a (6, 3)
array: position of its foot, velocity, angular velocity, and the three rows of its rotation matrix.
"""

import numpy as np

from .bow import bow_shape, give, give_bend, give_change, lateral_pull, stiffness_change
from .cubic import combine, first_weights, second_weights, weights
from .law import force, hertz_push
from .pin import distance, surface
from .vector import add, add_scaled, compiled, cross, dot, rotate, rotate_back, row, scale, subtract

PIECES = 4
"""Into which an element is cut to find a change of sign of h."""
MOST_CONTACTS, CONTACT_SIZE = 24, 5
"""Rows and columns of the list of contacts: cable's element, cylinder, ξ, gap, e."""
NEAR = 1e-4
"""Gap of the cubic below which its bow is looked at [m]; bows are some micrometres."""
TRIALS, CLOSE = 20, 1e-9
"""Most steps to where a bowed cable touches, and how near in ξ is near enough."""


@compiled
def slope_of_distance(cylinder, pin, element, fraction, size):
    """h = n · r' at ξ, and its derivative by s, in the pin's frame."""
    rotation = pin[3:6]
    y = rotate_back(rotation, subtract(combine(weights(fraction, size), element), row(pin, 0)))
    tangent = rotate_back(rotation, combine(first_weights(fraction, size), element))
    bow = rotate_back(rotation, combine(second_weights(fraction, size), element))
    _, normal, bend, across, roundness, around = surface(cylinder, y)
    curvature = bend * dot(across, tangent) ** 2 + roundness * dot(around, tangent) ** 2 + dot(normal, bow)
    return dot(normal, tangent), curvature


@compiled
def closest_fraction(cylinder, pin, element, low, high, size):
    """ξ between low and high where h = 0: Newton's method, halving the bracket where it would leave it."""
    fraction = 0.5 * (low + high)
    for _ in range(60):
        slope, curvature = slope_of_distance(cylinder, pin, element, fraction, size)
        if slope < 0.0:
            low = fraction
        else:
            high = fraction
        step = -slope / (curvature * size) if curvature != 0.0 else 0.0
        nearer = fraction + step
        if not low <= nearer <= high or curvature <= 0.0:
            nearer = 0.5 * (low + high)
        if abs(nearer - fraction) < 1e-14:
            return nearer
        fraction = nearer
    return fraction


@compiled
def slope_change(law, fraction, size, curvature, push, stiff):
    """Derivative of h + ½ e' f by s [1/m], as the force follows; never below a tenth of the cubic's own, h_s."""
    change = give_change(law, fraction, size)
    own = 0.5 * give_bend(law, fraction, size) - 0.25 * stiff * change * change
    return max(curvature + own * push, 0.1 * curvature)


@compiled
def bowed(law, element, size, cylinder, pin, fraction, radius, scratch):
    """Where the beam touches that the cubic stands for (see `bow`): ξ, gap, and e; ``fraction`` is the cubic's own ξ.

    There the energy of the contact is least along the cable, which makes its force the gradient of that energy:
    h + ½ e' f + b' = 0, in which n turns with the point: dn/ds = H r', see `pin`.
    """
    rotation = pin[3:6]
    curved = rotate_back(rotation, combine(second_weights(0.5, size), element))
    pull, stiffness = lateral_pull(law, element, size, scratch)
    gap, soft = 0.0, 0.0
    for _ in range(TRIALS):
        slope, curvature = slope_of_distance(cylinder, pin, element, fraction, size)
        y = rotate_back(rotation, subtract(combine(weights(fraction, size), element), row(pin, 0)))
        tangent = rotate_back(rotation, combine(first_weights(fraction, size), element))
        away, normal, sharp, across, roundness, around = surface(cylinder, y)
        bend = dot(normal, curved)
        turning = sharp * dot(across, tangent) * dot(across, curved)
        turning += roundness * dot(around, tangent) * dot(around, curved)
        shape, shape_change = bow_shape(law, fraction, size)
        gap = away - radius + pull * bend * shape
        soft = give(law, fraction, size) - stiffness * (bend * shape) ** 2
        if gap >= 0.0:
            break
        push, stiff = hertz_push(law, gap, soft)
        slope += 0.5 * give_change(law, fraction, size) * push
        slope += (pull - push * stiffness * bend * shape) * (bend * shape_change + shape * turning)
        before = fraction
        fraction -= slope / (size * slope_change(law, fraction, size, curvature, push, stiff))
        fraction = min(max(fraction, 0.0), 1.0)
        if abs(fraction - before) < CLOSE:
            break
    return fraction, gap, soft


@compiled
def find_contacts(positions, n_elements, size, cylinders, pin, law, radius, contacts):
    """List the contacts of all cables with the pin; returns how many."""
    count = 0
    scratch = np.empty((4, 3))
    rotation = pin[3:6]
    reach = 0.55 * size + radius  # no point of an element is farther than half its length from the nearer node
    for cable in range(positions.shape[0] // (2 * (n_elements + 1))):
        for number in range(n_elements):
            first_row = 2 * (cable * (n_elements + 1) + number)
            element = positions[first_row : first_row + 4]
            start = rotate_back(rotation, subtract(row(element, 0), row(pin, 0)))
            end = rotate_back(rotation, subtract(row(element, 2), row(pin, 0)))
            for part in range(cylinders.shape[0]):
                cylinder = cylinders[part]
                if min(distance(cylinder, start), distance(cylinder, end)) > reach:
                    continue
                before, _ = slope_of_distance(cylinder, pin, element, 0.0, size)
                for piece in range(PIECES):
                    high = (piece + 1) / PIECES
                    after, _ = slope_of_distance(cylinder, pin, element, high, size)
                    if before < 0.0 <= after:
                        fraction = closest_fraction(cylinder, pin, element, piece / PIECES, high, size)
                        point = combine(weights(fraction, size), element)
                        gap = distance(cylinder, rotate_back(rotation, subtract(point, row(pin, 0)))) - radius
                        if gap < NEAR and count < contacts.shape[0]:
                            fraction, gap, soft = bowed(law, element, size, cylinder, pin, fraction, radius, scratch)
                            if gap < 0.0:
                                contacts[count, 0] = first_row
                                contacts[count, 1] = part
                                contacts[count, 2] = fraction
                                contacts[count, 3] = gap
                                contacts[count, 4] = soft
                                count += 1
                    before = after
    return count


@compiled
def contact_force(positions, velocities, size, cylinders, pin, law, contact, within):
    """Force on the cable at a listed contact, its point, normal, velocity against the pin, and couple on the pin.

    Fills `within` (4, 3): what a unit of normal force is on the element's coordinates beside that at its point, ∂b/∂q.
    """
    first_row, part, fraction, gap, soft = int(contact[0]), int(contact[1]), contact[2], contact[3], contact[4]
    n, n2 = weights(fraction, size), second_weights(0.5, size)
    element = positions[first_row : first_row + 4]
    point = combine(n, element)
    arm = subtract(point, row(pin, 0))
    _, normal, bend, across, roundness, around = surface(cylinders[part], rotate_back(pin[3:6], arm))
    normal, across, around = rotate(pin[3:6], normal), rotate(pin[3:6], across), rotate(pin[3:6], around)
    pin_velocity = add_scaled(row(pin, 1), 1.0, cross(row(pin, 2), arm))
    velocity = subtract(combine(n, velocities[first_row : first_row + 4]), pin_velocity)
    push = force(law, gap, soft, normal, velocity)
    size_of = dot(push, normal)
    curved = combine(n2, element)
    share = dot(normal, curved)
    pull, stiffness = lateral_pull(law, element, size, within)
    shape, _ = bow_shape(law, fraction, size)
    pull -= size_of * stiffness * share * shape
    softer = size_of * (share * shape) ** 2 * stiffness_change(law, element, size)  # −½ f (B n · r''_m)² ∂k/∂q
    for a in range(4):
        for k in range(3):
            within[a, k] = shape * (share * within[a, k] + pull * normal[k] * n2[a]) + softer * curved[k] * n2[a]
    turn = size_of * shape * pull  # the normal turns as the point moves
    push = add_scaled(push, turn * bend * dot(across, curved), across)
    push = add_scaled(push, turn * roundness * dot(around, curved), around)
    return push, point, normal, velocity, scale(size_of * shape * pull, cross(normal, curved))


@compiled
def add_pin_contact(positions, velocities, n_elements, size, cylinders, pin, law, radius, contacts, forces):
    """Add the generalised forces to `forces` (n_rows, 3); returns force and moment on the pin about its foot."""
    total = (0.0, 0.0, 0.0)
    moment = (0.0, 0.0, 0.0)
    within = np.empty((4, 3))
    count = find_contacts(positions, n_elements, size, cylinders, pin, law, radius, contacts)
    for index in range(count):
        push, point, normal, _, couple = contact_force(
            positions, velocities, size, cylinders, pin, law, contacts[index], within
        )
        first_row, n, size_of = int(contacts[index, 0]), weights(contacts[index, 2], size), dot(push, normal)
        for a in range(4):
            for axis in range(3):
                forces[first_row + a, axis] += n[a] * push[axis] + size_of * within[a, axis]
        total = subtract(total, push)
        moment = add(subtract(moment, cross(subtract(point, row(pin, 0)), push)), couple)
    return total, moment


@compiled
def start_overlap(positions, n_elements, size, cylinders, pin, radius):
    """Deepest overlap of any cable with the pin [m], sampled: also where a cable's axis runs inside the pin."""
    deepest = -1e9
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        element = positions[first_row : first_row + 4]
        for station in range(21):
            point = combine(weights(station / 20, size), element)
            y = rotate_back(pin[3:6], subtract(point, row(pin, 0)))
            for part in range(cylinders.shape[0]):
                deepest = max(deepest, radius - distance(cylinders[part], y))
    return deepest
