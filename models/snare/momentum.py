"""Momentum of the cables and of a floating target.

Cables: P = ∫ ρA ṙ ds and L = ∫ ρA r × ṙ ds over the elements' own cubics, exact with four Gauss points. The linear one
changes by outside forces alone, step by step, as the elements' mass matrix is constant.
"""

import numpy as np

from .assembly import SnareAssembly
from .cubic import MASS_POINTS, combine, weights
from .vector import add, compiled, cross, rotate, rotate_back, row, scale


@compiled
def cable_momentum(positions, velocities, n_elements, size, mass_per_length):
    """Linear and angular momentum of all cables [N·s, N·m·s], shape (6,), of nodes (r, r') and their rates."""
    result = np.zeros(6)
    for first_row in range(0, positions.shape[0] - 2, 2):
        if (first_row // 2 + 1) % (n_elements + 1) == 0:
            continue
        element = positions[first_row : first_row + 4]
        rates = velocities[first_row : first_row + 4]
        for i in range(4):
            shape = weights(MASS_POINTS[i, 0], size)
            speed = combine(shape, rates)
            turn = cross(combine(shape, element), speed)
            mass = MASS_POINTS[i, 1] * size * mass_per_length
            for k in range(3):
                result[k] += mass * speed[k]
                result[3 + k] += mass * turn[k]
    return result


@compiled
def body_momentum(mass, centre, inertia, pin):
    """Linear and angular momentum (6,) of a body: its mass, centre of mass, inertia about it, and frame (6, 3)."""
    arm = rotate(pin[3:6], centre)
    speed = add(row(pin, 1), cross(row(pin, 2), arm))
    spin = rotate(pin[3:6], rotate(inertia, rotate_back(pin[3:6], row(pin, 2))))
    turn = add(cross(add(row(pin, 0), arm), scale(mass, speed)), spin)
    return np.array([mass * speed[0], mass * speed[1], mass * speed[2], turn[0], turn[1], turn[2]])


@compiled
def left_over(gained, effector, foot, on_pin):
    """Impulse and its moment about the effector's origin (6,), where cables and target have gained so much.

    ``effector`` and ``foot`` (3,) are where effector and pin were in the middle, ``on_pin`` (6,) what a moved pin got.
    """
    linear = (-gained[0] - on_pin[0], -gained[1] - on_pin[1], -gained[2] - on_pin[2])
    result = np.empty(6)
    by_effector, by_pin = cross(effector, linear), cross(foot, on_pin)
    for k in range(3):
        result[k] = linear[k]
        result[3 + k] = -gained[3 + k] - by_effector[k] - by_pin[k] - on_pin[3 + k]
    return result


def momentum(assembly: SnareAssembly) -> np.ndarray:
    """Momentum (6,) of the cables and of a target that floats; a moved one belongs to whoever moves it.

    Linear first [N·s], then angular about the origin of the assembly's positions [N·m·s].
    """
    data, n, target = assembly.system.systemData, assembly.n_cable_coordinates, assembly.target
    positions = data.GetODE2Coordinates()[:n].reshape(-1, 3) + assembly.nodes.reshape(-1, 3)
    velocities = data.GetODE2Coordinates_t()[:n].reshape(-1, 3)
    mass_per_length = assembly.parameters.mass_per_length
    total = cable_momentum(positions, velocities, assembly.n_elements, assembly.size, mass_per_length)
    if assembly.n_pin:
        inertia = np.asarray(target.inertia, float) if target.rotates else np.zeros((3, 3))
        total += body_momentum(target.mass, tuple(target.centre_of_mass), inertia, assembly.pin)
    return total
