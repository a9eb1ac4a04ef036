"""Contact of the cables with one another: two cubics, nearest where their distance is perpendicular to both.

With D = r₁(s) − r₂(t) and n = D/|D|, the pair (s, t) solves n · r₁' = n · r₂' = 0, by Newton's method on each pair of
elements near enough; the law of the force is that of the pin. Cables cross before they touch along a length: pairs
within half a degree of parallel are left out. The cables of an empty snare meet past 80° of the ring.
"""

from .bow import give, give_change
from .cubic import combine, first_weights, second_weights, weights
from .law import force, force_change
from .vector import add, add_scaled, compiled, dot, length, scale, subtract, unit

MOST_CROSSINGS = 12
"""Rows of the list of crossings: first rows of both elements, ξ of both, gap."""
_ZERO = (0.0, 0.0, 0.0)
_PARALLEL = 1e-4  # least sin² of the angle between two cables


@compiled
def _nearest(one, two, size):
    """ξ of both elements where they are nearest to each other; outside 0 … 1 where that is not on them."""
    x, y = 0.5, 0.5
    for _ in range(20):
        apart = subtract(combine(weights(x, size), one), combine(weights(y, size), two))
        along, across = combine(first_weights(x, size), one), combine(first_weights(y, size), two)
        a = dot(along, along) + dot(apart, combine(second_weights(x, size), one))
        b = -dot(along, across)
        d = dot(across, across) - dot(apart, combine(second_weights(y, size), two))
        determinant = a * d - b * b
        if determinant < _PARALLEL:
            return -1.0, -1.0
        g, h = dot(apart, along), -dot(apart, across)
        x_step = -(d * g - b * h) / (determinant * size)
        y_step = -(a * h - b * g) / (determinant * size)
        x, y = x + x_step, y + y_step
        if not (-1.0 < x < 2.0 and -1.0 < y < 2.0):
            return -1.0, -1.0
        if abs(x_step) + abs(y_step) < 1e-14:
            break
    return x, y


@compiled
def find_crossings(positions, n_elements, size, radius, crossings):
    """List where two cables overlap; returns how many."""
    count = 0
    reach = (1.02 * size + 2 * radius) ** 2  # between middles of chords
    rows = 2 * (n_elements + 1)
    for first in range(3):
        second = (first + 1) % 3
        for i in range(n_elements):
            row_one = first * rows + 2 * i
            for j in range(n_elements):
                row_two = second * rows + 2 * j
                square = 0.0
                for k in range(3):
                    middle = positions[row_one, k] + positions[row_one + 2, k]
                    square += (0.5 * (middle - positions[row_two, k] - positions[row_two + 2, k])) ** 2
                if square > reach:
                    continue
                one, two = positions[row_one : row_one + 4], positions[row_two : row_two + 4]
                x, y = _nearest(one, two, size)
                if not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
                    continue
                apart = subtract(combine(weights(x, size), one), combine(weights(y, size), two))
                gap = length(apart) - 2 * radius
                if gap < 0.0 and count < crossings.shape[0]:
                    crossings[count, 0], crossings[count, 1] = row_one, row_two
                    crossings[count, 2], crossings[count, 3], crossings[count, 4] = x, y, gap
                    count += 1
    return count


@compiled
def crossing_give(law, crossing, size):
    """e of both elements together [m/N]."""
    return give(law, crossing[2], size) + give(law, crossing[3], size)


@compiled
def crossing_force(positions, velocities, size, law, crossing):
    """Force on the first cable, n, |D|, and velocity of the first against the second."""
    one, two = int(crossing[0]), int(crossing[1])
    n, m = weights(crossing[2], size), weights(crossing[3], size)
    apart = subtract(combine(n, positions[one : one + 4]), combine(m, positions[two : two + 4]))
    speed = subtract(combine(n, velocities[one : one + 4]), combine(m, velocities[two : two + 4]))
    distance = length(apart)
    normal = scale(1.0 / distance, apart)
    return force(law, crossing[4], crossing_give(law, crossing, size), normal, speed), normal, distance, speed


@compiled
def add_crossings(positions, velocities, n_elements, size, law, radius, crossings, forces):
    """Add all generalised forces of cables on one another to `forces` (n_rows, 3)."""
    for index in range(find_crossings(positions, n_elements, size, radius, crossings)):
        push, _, _, _ = crossing_force(positions, velocities, size, law, crossings[index])
        one, two = int(crossings[index, 0]), int(crossings[index, 1])
        n, m = weights(crossings[index, 2], size), weights(crossings[index, 3], size)
        for a in range(4):
            for k in range(3):
                forces[one + a, k] += n[a] * push[k]
                forces[two + a, k] -= m[a] * push[k]


@compiled
def _across(normal, distance, a):
    """Change of n with a change of D: (I − n nᵀ) a/|D|."""
    return scale(1.0 / distance, add_scaled(a, -dot(normal, a), normal))


@compiled
def add_crossing_jacobian(positions, velocities, size, law, crossings, n_crossings, factors, triplets, count):
    """Append the triplets of all listed crossings, as `contact_jacobian` does; returns the new count."""
    for index in range(n_crossings):
        one, two, gap = int(crossings[index, 0]), int(crossings[index, 1]), crossings[index, 4]
        x, y = crossings[index, 2], crossings[index, 3]
        push, normal, distance, speed = crossing_force(positions, velocities, size, law, crossings[index])
        n, n1 = weights(x, size), first_weights(x, size)
        m, m1 = weights(y, size), first_weights(y, size)
        along, across = combine(n1, positions[one : one + 4]), combine(m1, positions[two : two + 4])
        along_turn, across_turn = _across(normal, distance, along), _across(normal, distance, across)
        a = dot(along_turn, along) + dot(normal, combine(second_weights(x, size), positions[one : one + 4]))
        b = -dot(across_turn, along)
        c = dot(along_turn, across)
        d = -dot(across_turn, across) + dot(normal, combine(second_weights(y, size), positions[two : two + 4]))
        determinant = a * d - b * c
        soft = crossing_give(law, crossings[index], size)
        along_rate, across_rate = combine(n1, velocities[one : one + 4]), combine(m1, velocities[two : two + 4])
        for j in range(24):
            part, node_vector, axis = j // 12, (j % 12) // 3, j % 3
            if part == 0:
                moved = scale(n[node_vector], unit(axis))
                tangent_change = scale(n1[node_vector], unit(axis))
            else:
                moved = scale(-m[node_vector], unit(axis))
                tangent_change = scale(m1[node_vector], unit(axis))
            n_change = _across(normal, distance, moved)
            g = dot(n_change, along) + (dot(normal, tangent_change) if part == 0 else 0.0)
            h = dot(n_change, across) + (dot(normal, tangent_change) if part == 1 else 0.0)
            s_change = -(d * g - b * h) / determinant
            t_change = -(a * h - c * g) / determinant
            n_change = add_scaled(add_scaled(n_change, s_change, along_turn), -t_change, across_turn)
            w_change = subtract(scale(s_change, along_rate), scale(t_change, across_rate))
            soft_change = give_change(law, x, size) * s_change + give_change(law, y, size) * t_change
            still = force_change(law, gap, soft, normal, speed, dot(normal, moved), soft_change, n_change, w_change)
            moving = force_change(law, gap, soft, normal, speed, 0.0, 0.0, _ZERO, moved)
            change = add(scale(factors[0], still), scale(factors[1], moving))
            column = 3 * (one if part == 0 else two) + j % 12
            for v in range(4):
                first = add_scaled(scale(n[v], change), factors[0] * n1[v] * s_change, push)
                second = add_scaled(scale(m[v], change), factors[0] * m1[v] * t_change, push)
                for k in range(3):
                    if count + 2 > triplets.shape[0]:
                        return count
                    if first[k] != 0.0:
                        triplets[count, 0], triplets[count, 1] = 3 * (one + v) + k, column
                        triplets[count, 2] = -first[k]
                        count += 1
                    if second[k] != 0.0:
                        triplets[count, 0], triplets[count, 1] = 3 * (two + v) + k, column
                        triplets[count, 2] = second[k]
                        count += 1
    return count
