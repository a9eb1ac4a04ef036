"""Inertial parameters of one rigid body: ten numbers in which joint torque is linear.

The vector is ``phi = (m, m*cx, m*cy, m*cz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz)`` [kg, kg·m, kg·m²]: mass, mass times
centre of mass, and the inertia about the *origin* of the link frame, in its axes (Atkeson, An, Hollerbach 1986).
Parameters of bodies welded together add up. A body is physical when its mass density can be non-negative everywhere,
that is when the 4x4 pseudo-inertia is positive semi-definite (Wensing, Kim, Slotine 2018); with the mass and centre of
mass given, this is the triangle inequality of the principal moments about the centre of mass.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_ROW, _COLUMN = np.triu_indices(3)


def symmetric(six: ArrayLike) -> Array:
    """(xx, xy, xz, yy, yz, zz) as a symmetric matrix of shape (3, 3)."""
    matrix = np.empty((3, 3))
    matrix[_ROW, _COLUMN] = six
    matrix[_COLUMN, _ROW] = six
    return matrix


def _about_origin(mass: float, arm: Array) -> Array:
    """Inertia (3, 3) of a point mass [kg] at ``arm`` (3,) [m] about the origin (Steiner)."""
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def from_central(mass: float, com: ArrayLike, inertia: ArrayLike) -> Array:
    """Parameters phi (10,) from mass [kg], centre of mass (3,) [m] and inertia (3, 3) about it [kg·m²]."""
    com = np.asarray(com, float)
    about_origin = np.asarray(inertia, float) + _about_origin(mass, com)
    return np.concatenate([[mass], mass * com, about_origin[_ROW, _COLUMN]])


def to_central(phi: ArrayLike) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass (3,) [m] and inertia (3, 3) about it [kg·m²]; a body of no mass has its own at 0."""
    phi = np.asarray(phi, float)
    mass = float(phi[0])
    com = phi[1:4] / mass if mass else np.zeros(3)
    return mass, com, symmetric(phi[4:]) - _about_origin(mass, com)


def transform(phi: ArrayLike, rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Parameters (10,) of the same body about another frame.

    ``rotation`` (3, 3) and ``translation`` (3,) [m] are the pose of phi's frame in the new one.
    """
    rotation, translation = np.asarray(rotation, float), np.asarray(translation, float)
    mass, com, inertia = to_central(phi)
    return from_central(mass, rotation @ com + translation, rotation @ inertia @ rotation.T)


def pseudo_inertia(phi: ArrayLike) -> Array:
    """Pseudo-inertia (4, 4): density-weighted second moments of (x, y, z, 1) (Wensing, Kim, Slotine 2018, eq. 11)."""
    phi = np.asarray(phi, float)
    inertia = symmetric(phi[4:])
    matrix = np.empty((4, 4))
    matrix[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    matrix[:3, 3] = matrix[3, :3] = phi[1:4]
    matrix[3, 3] = phi[0]
    return matrix


def from_pseudo_inertia(matrix: ArrayLike) -> Array:
    """Parameters phi (10,) of a pseudo-inertia (4, 4): the inverse of `pseudo_inertia`."""
    matrix = np.asarray(matrix, float)
    inertia = np.trace(matrix[:3, :3]) * np.eye(3) - matrix[:3, :3]
    return np.concatenate([[matrix[3, 3]], matrix[:3, 3], inertia[_ROW, _COLUMN]])


def is_physical(phi: ArrayLike, tolerance: float = 1e-9) -> bool:
    """Whether some non-negative mass density has these parameters (10,).

    Point masses, rods and plates, the limits of bodies, count as physical, and so does no body at all (phi = 0).
    ``tolerance`` is relative to the trace of the inertia about the centre of mass: what rounding in a file may take.
    """
    phi = np.asarray(phi, float)
    if not np.all(np.isfinite(phi)) or phi[0] < 0:
        return False
    if phi[0] == 0:
        return not np.any(phi)
    _, com, inertia = to_central(phi)
    moments = np.linalg.eigvalsh(inertia)
    # the shift to the centre of mass cancels digits: its rounding is no fault of the body
    rounding = 1e-14 * phi[0] * (com @ com)
    return bool(moments[0] + moments[1] - moments[2] >= -(tolerance * np.abs(moments).sum() + rounding))


def nearest_physical(mass: float, com: ArrayLike, inertia: ArrayLike) -> Array:
    """Parameters phi (10,) of the physical body nearest in inertia; mass and centre of mass are kept.

    Nearest in the Frobenius norm of the inertia (3, 3) about the centre of mass. The set of physical inertias is convex
    and turns with the body, so the principal axes stay and only the moments move: with the body's second moments
    s >= 0 along its axes, moments are ``(s2 + s3, s1 + s3, s1 + s2)``, a non-negative least-squares problem
    (Lawson, Hanson 1974).
    """
    from scipy.optimize import nnls  # here only: a second at the start of every process that knows a body

    moments, axes = np.linalg.eigh(np.asarray(inertia, float))
    to_moments = 1.0 - np.eye(3)
    second, _ = nnls(to_moments, moments)
    return from_central(mass, com, axes @ np.diag(to_moments @ second) @ axes.T)
