"""Rotations as CasADi expressions: about an axis, from and to a quaternion (w, x, y, z)."""

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray


def exact(matrix: ArrayLike) -> ca.SX:
    """Constants with rounded zeros and ones made exact, so that CasADi drops their products."""
    values = np.asarray(matrix, float)
    rounded = np.round(values)
    return ca.SX(ca.sparsify(ca.DM(np.where(np.abs(values - rounded) < 1e-15, rounded, values))))


def turn(axis: NDArray[np.float64], angle: ca.SX) -> ca.SX:
    """Rotation matrix (3, 3) about a unit axis (3,) by an angle [rad] (Rodrigues)."""
    along = np.outer(axis, axis)
    return ca.cos(angle) * exact(np.eye(3) - along) + ca.sin(angle) * ca.skew(exact(axis)) + exact(along)


def rotation_of(quaternion: ca.SX) -> ca.SX:
    """Rotation matrix (3, 3) of a quaternion of any length; base to world."""
    unit = quaternion / ca.norm_2(quaternion)
    w, vector = unit[0], unit[1:]
    cross = ca.skew(vector)
    return ca.SX.eye(3) + 2 * w * cross + 2 * cross @ cross


def quaternion_of(rotation: ca.SX) -> ca.SX:
    """Quaternion, w >= 0, of a rotation matrix: the largest of four forms (Shepperd 1978)."""
    r = rotation
    forms = [
        ca.vertcat(1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]),
        ca.vertcat(r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        ca.vertcat(r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]),
        ca.vertcat(r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]),
    ]
    best, size = forms[0], forms[0][0]
    for k in range(1, 4):
        larger = forms[k][k] > size
        best, size = ca.if_else(larger, forms[k], best), ca.if_else(larger, forms[k][k], size)
    unit = best / ca.norm_2(best)
    return ca.if_else(unit[0] < 0, -unit, unit)


def quaternion_rate(quaternion: ca.SX, spin: ca.SX) -> ca.SX:
    """Rate (4,) of a quaternion at the angular velocity ``spin`` (3,) in the turning frame [rad/s]."""
    w, vector = quaternion[0], quaternion[1:]
    return 0.5 * ca.vertcat(-ca.dot(vector, spin), w * spin + ca.cross(vector, spin))
