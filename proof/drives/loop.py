"""Drives in closed loop, compiled: bodies, springs and friction by the implicit midpoint rule, the servo in ticks.

The midpoint rule is of second order and keeps momenta; friction is evaluated over the whole step, so that it holds
where it sticks. A joint with a spring has two coordinates, its motor's and its link's; every other has one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .bodies import inverse, mass_matrix, pose
from .compiled import compiled
from .laws import slid, torque, went

TICK = 1e-3
"""Period of the servo [s]."""

STEPS = 4
"""Steps of integration a tick."""

MOST, CLOSE = 12, 1e-9
"""Iterations a step, and the change of speed [rad/s, relative above 1 rad/s] that ends them."""


class Drives(NamedTuple):
    """Numbers of n drives. ``motor``: coordinate of each joint's motor, its own number where the drive is rigid.

    ``rotor`` [kg·m²] at the joint; ``stiffness`` [N·m/rad], ``damping`` [N·m·s/rad] and ``gap`` [rad] of its spring;
    ``lag`` [s] of the current; ``limit`` [N·m]; ``kp`` [N·m/rad], ``kd`` [N·m·s/rad]; ``count`` [rad] of the
    servo's own encoder; ``filter``: share of a new speed in the servo's filtered one.
    """

    motor: NDArray
    rotor: NDArray
    stiffness: NDArray
    damping: NDArray
    gap: NDArray
    lag: NDArray
    limit: NDArray
    kp: NDArray
    kd: NDArray
    count: NDArray
    filter: NDArray


@compiled
def factored(a, size):
    """Cholesky factor of a symmetric matrix in place, in its lower part."""
    for j in range(size):
        for i in range(j, size):
            found = a[i, j]
            for k in range(j):
                found -= a[i, k] * a[j, k]
            a[i, j] = np.sqrt(found) if i == j else found / a[j, j]


@compiled
def solved(a, b, size):
    """Solve with a factor of `factored`, in place."""
    for i in range(size):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]


@compiled
def spring(drives, k, twist, rate):
    """Torque that a drive's spring hands to its link [N·m]: nothing but a tenth of its damping inside the play."""
    half = 0.5 * drives.gap[k]
    beyond = twist - min(max(twist, -half), half)
    grip = 1.0 if half == 0.0 or beyond != 0.0 else 0.1
    return drives.stiffness[k] * beyond + grip * drives.damping[k] * rate


@compiled
def run(bodies, drives, friction, laws, motion, feedforward, pushes, start, free):
    """Simulate; what is true at every tick: motor's q, qd, qdd, torque, what resists it, load, and the link's q.

    ``motion`` (n_ticks, 2, n): asked q and qd. ``feedforward``, ``pushes`` (n_ticks, n) [N·m]: the latter act on the
    motor, between ticks by a line. ``start``: time [s] of the first tick. ``free``: nothing is driven. The result is
    (n_ticks, 7, n).
    """
    count, n = feedforward.shape
    size = max(n, drives.motor.max() + 1)
    h = TICK / STEPS
    kind, travel, slow = friction.kind, friction.travel, friction.lag
    q, qd, qdd = np.zeros(size), np.zeros(size), np.zeros(size)
    for j in range(n):
        q[j] = motion[0, 0, j]
        q[drives.motor[j]] = motion[0, 0, j]
    current, seen, speed = feedforward[0].copy(), np.zeros(n), np.zeros(n)
    for j in range(n):
        seen[j] = np.round(q[drives.motor[j]] / drives.count[j]) * drives.count[j]
    bristles, after = np.zeros((n, 4)), np.zeros((n, 4))
    heat = np.zeros(laws.number.size)
    direction, resisting, load, given = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    turns, inertias, matrix = np.empty((n, 3, 3)), np.empty((n, 3, 3)), np.empty((n, n))
    origins, axes, coms = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    half, middle, left = np.empty(size), np.empty(size), np.empty(size)
    a, found = np.empty((size, size)), np.empty((count, 7, n))
    command = np.zeros(n)
    for tick in range(count):
        for j in range(n):
            m = drives.motor[j]
            reading = np.round(q[m] / drives.count[j]) * drives.count[j]
            speed[j] += drives.filter[j] * ((reading - seen[j]) / TICK - speed[j])
            seen[j] = reading
            asked = feedforward[tick, j]
            asked += drives.kp[j] * (motion[tick, 0, j] - reading) + drives.kd[j] * (motion[tick, 1, j] - speed[j])
            command[j] = 0.0 if free else min(max(asked, -drives.limit[j]), drives.limit[j])
            found[tick, 0, j], found[tick, 1, j], found[tick, 2, j] = q[m], qd[m], qdd[m]
            found[tick, 3, j], found[tick, 4, j] = current[j], resisting[j]
            found[tick, 5, j], found[tick, 6, j] = load[j], q[j]
        for step in range(STEPS):
            time = start + tick * TICK + (step + 0.5) * h
            part = (step + 0.5) / STEPS
            following = min(tick + 1, count - 1)
            for i in range(size):
                half[i] = q[i] + 0.5 * h * qd[i]
            pose(bodies, half[:n], turns, origins, axes, coms, inertias)
            mass_matrix(bodies, origins, axes, coms, inertias, matrix)
            a[:] = 0.0
            for i in range(n):
                for j in range(n):
                    a[i, j] = matrix[i, j] / h
            for j in range(n):
                m = drives.motor[j]
                a[m, m] += drives.rotor[j] / h + 0.5 * friction.viscous[j]
                a[m, m] += 0.25 * h * friction.level[j] / friction.travel[j]
                if m != j:
                    stiff = 0.25 * h * drives.stiffness[j] + 0.5 * drives.damping[j]
                    a[m, m] += stiff
                    a[j, j] += stiff
                    a[m, j] -= stiff
                    a[j, m] -= stiff
                given[j] = command[j] + (current[j] - command[j]) * np.exp(-0.5 * h / drives.lag[j])
            factored(a, size)
            for _ in range(MOST):
                for i in range(size):
                    middle[i] = qd[i] + 0.5 * h * qdd[i]
                inverse(bodies, origins, axes, coms, inertias, middle[:n], qdd[:n], load)
                for j in range(n):
                    m = drives.motor[j]
                    move = h * middle[m]
                    direction[j] = slid(kind[j], bristles[j], move, middle[m], travel[j], slow[j], after[j])
                    resisting[j] = friction.level[j] * direction[j] + friction.viscous[j] * middle[m]
                for k in range(laws.number.size):
                    j, o = laws.joint[k], laws.other[k]
                    m, other = drives.motor[j], drives.motor[o]
                    resisting[j] += laws.size[k] * torque(
                        laws.number[k],
                        laws.numbers[k],
                        laws.table[k],
                        time,
                        q[m] + 0.5 * h * middle[m],
                        middle[m],
                        direction[j],
                        load[j],
                        given[j],
                        q[other] + 0.5 * h * middle[other],
                        middle[other],
                        heat[k],
                    )
                for j in range(n):
                    m = drives.motor[j]
                    push = pushes[tick, j] * (1.0 - part) + pushes[following, j] * part
                    inward = given[j] + push - resisting[j] - drives.rotor[j] * qdd[m]
                    if m == j:
                        left[j] = inward - load[j]
                    else:
                        twist = q[m] - q[j] + 0.5 * h * (middle[m] - middle[j])
                        carried = spring(drives, j, twist, middle[m] - middle[j])
                        left[m] = inward - carried
                        left[j] = carried - load[j]
                solved(a, left, size)
                change = 0.0
                for i in range(size):
                    qdd[i] += left[i] / h
                    change = max(change, abs(left[i]) / max(1.0, abs(qd[i])))
                if change < CLOSE:
                    break
            for i in range(size):
                middle[i] = qd[i] + 0.5 * h * qdd[i]
                q[i] += h * middle[i]
                qd[i] += h * qdd[i]
            for j in range(n):
                m = drives.motor[j]
                direction[j] = slid(kind[j], bristles[j], h * middle[m], middle[m], travel[j], slow[j], after[j])
                bristles[j] = after[j]
                current[j] = command[j] + (current[j] - command[j]) * np.exp(-h / drives.lag[j])
            for k in range(laws.number.size):
                j = laws.joint[k]
                m = drives.motor[j]
                heat[k] = went(laws.number[k], laws.numbers[k], heat[k], h, h * middle[m], middle[m], direction[j])
    return found
