"""Rigid bodies of an arm in compiled code: torque and mass matrix from the numbers of a Pinocchio model.

Newton-Euler in world axes with 3-vectors (Luh, Walker and Paul 1980), composite bodies for the mass matrix
(Walker and Orin 1982). Tests hold both to Pinocchio's own algorithms.
"""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that pinocchio takes from its compiled module)
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .compiled import compiled


class Bodies(NamedTuple):
    """Numbers of a chain of n revolute joints; body k hangs on joint k, all in joint k's frame.

    ``turn`` (n, 3, 3) and ``place`` (n, 3) [m]: joint frame in its parent's at zero angle. ``axis`` (n, 3).
    ``mass`` (n,) [kg], ``com`` (n, 3) [m], ``inertia`` (n, 3, 3) [kg·m²] about the centre of mass.
    ``gravity`` (3,) [m/s²].
    """

    turn: NDArray
    place: NDArray
    axis: NDArray
    mass: NDArray
    com: NDArray
    inertia: NDArray
    gravity: NDArray

    @staticmethod
    def of(model: pin.Model) -> "Bodies":
        """Read from a chain whose joints all turn."""
        joints = range(1, model.njoints)
        data = model.createData()
        pin.computeJointJacobians(model, data, np.zeros(model.nq))
        jacobian = np.reshape(data.J, (6, -1))  # of one joint, pinocchio gives a vector
        axes = [data.oMi[k].rotation.T @ jacobian[3:, k - 1] for k in joints]
        return Bodies(
            np.array([model.jointPlacements[k].rotation for k in joints]),
            np.array([model.jointPlacements[k].translation for k in joints]),
            np.array(axes),
            np.array([model.inertias[k].mass for k in joints]),
            np.array([model.inertias[k].lever for k in joints]),
            np.array([model.inertias[k].inertia for k in joints]),
            np.array(model.gravity.linear),
        )


@compiled
def _turned(axis, angle):
    """Rotation (3, 3) about a unit axis (Rodrigues)."""
    x, y, z = axis[0], axis[1], axis[2]
    s, c = np.sin(angle), np.cos(angle)
    d = 1.0 - c
    found = np.empty((3, 3))
    found[0, 0], found[0, 1], found[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    found[1, 0], found[1, 1], found[1, 2] = d * x * y + s * z, c + d * y * y, d * y * z - s * x
    found[2, 0], found[2, 1], found[2, 2] = d * x * z - s * y, d * y * z + s * x, c + d * z * z
    return found


@compiled
def _cross(out, a, b):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def _product(out, a, b):
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@compiled
def pose(bodies, q, turns, origins, axes, coms, inertias):
    """Fill, in world axes: rotations, origins, axes, centres of mass (from the world's origin), inertias."""
    n = q.size
    joint, own = np.empty((3, 3)), np.empty((3, 3))
    for k in range(n):
        if k == 0:
            joint[:] = bodies.turn[0]
            origins[0] = bodies.place[0]
        else:
            _product(joint, turns[k - 1], bodies.turn[k])
            for i in range(3):
                origins[k, i] = origins[k - 1, i]
                for j in range(3):
                    origins[k, i] += turns[k - 1, i, j] * bodies.place[k, j]
        _product(turns[k], joint, _turned(bodies.axis[k], q[k]))
        turn = turns[k]
        _product(own, turn, bodies.inertia[k])
        for i in range(3):
            axes[k, i] = (
                turn[i, 0] * bodies.axis[k, 0] + turn[i, 1] * bodies.axis[k, 1] + turn[i, 2] * bodies.axis[k, 2]
            )
            coms[k, i] = origins[k, i]
            for j in range(3):
                coms[k, i] += turn[i, j] * bodies.com[k, j]
                inertias[k, i, j] = own[i, 0] * turn[j, 0] + own[i, 1] * turn[j, 1] + own[i, 2] * turn[j, 2]


@compiled
def mass_matrix(bodies, origins, axes, coms, inertias, out):
    """Joint-space mass matrix [kg·m²] into ``out`` (its first n rows and columns), from what `pose` filled."""
    n = bodies.mass.size
    mass, moment, about = 0.0, np.zeros(3), np.zeros((3, 3))
    force, torque, arm, part = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(n - 1, -1, -1):
        # The bodies from k on as one: mass, first moment and inertia about the world's origin.
        m, c = bodies.mass[k], coms[k]
        mass += m
        square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
        for i in range(3):
            moment[i] += m * c[i]
            for j in range(3):
                about[i, j] += inertias[k, i, j] - m * c[i] * c[j]
            about[i, i] += m * square
        # Acceleration of one about axis k: velocity field z x (r - p); momentum of the composite about the origin.
        z, p = axes[k], origins[k]
        for i in range(3):
            arm[i] = moment[i] - mass * p[i]
        _cross(force, z, arm)
        _cross(part, z, p)
        _cross(torque, part, moment)
        for i in range(3):
            torque[i] += about[i, 0] * z[0] + about[i, 1] * z[1] + about[i, 2] * z[2]
        for j in range(k + 1):
            # Moment of that momentum about axis j.
            _cross(part, origins[j], force)
            found = 0.0
            for i in range(3):
                found += axes[j, i] * (torque[i] - part[i])
            out[j, k] = found
            out[k, j] = found


@compiled
def inverse(bodies, origins, axes, coms, inertias, qd, qdd, out):
    """Joint torques [N·m] for speeds and accelerations, into ``out``, from what `pose` filled."""
    n = qd.size
    spin, turn, still = np.zeros(3), np.zeros(3), -bodies.gravity
    forces, moments = np.empty((n, 3)), np.empty((n, 3))
    step, part, more, own = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    origin = np.zeros(3)
    for k in range(n):
        z = axes[k]
        for i in range(3):
            step[i] = origins[k, i] - origin[i]
            origin[i] = origins[k, i]
        # The joint's origin is a point of the body before.
        _cross(part, turn, step)
        _cross(more, spin, step)
        _cross(own, spin, more)
        for i in range(3):
            still[i] = still[i] + part[i] + own[i]
        _cross(part, spin, z)
        for i in range(3):
            turn[i] += z[i] * qdd[k] + part[i] * qd[k]
            spin[i] += z[i] * qd[k]
        for i in range(3):
            step[i] = coms[k, i] - origins[k, i]
        _cross(part, turn, step)
        _cross(more, spin, step)
        _cross(own, spin, more)
        for i in range(3):
            forces[k, i] = bodies.mass[k] * (still[i] + part[i] + own[i])
        for i in range(3):
            more[i] = inertias[k, i, 0] * spin[0] + inertias[k, i, 1] * spin[1] + inertias[k, i, 2] * spin[2]
        _cross(own, spin, more)
        for i in range(3):
            moments[k, i] = (
                inertias[k, i, 0] * turn[0] + inertias[k, i, 1] * turn[1] + inertias[k, i, 2] * turn[2] + own[i]
            )
    # Sum from the tip: force and its moment about the world's origin.
    force, moment = np.zeros(3), np.zeros(3)
    for k in range(n - 1, -1, -1):
        _cross(part, coms[k], forces[k])
        for i in range(3):
            force[i] += forces[k, i]
            moment[i] += moments[k, i] + part[i]
        _cross(part, origins[k], force)
        out[k] = 0.0
        for i in range(3):
            out[k] += axes[k, i] * (moment[i] - part[i])


@compiled
def torques(bodies, q, qd, qdd):
    """Joint torques (n_samples, n) [N·m] along a motion, arrays (n_samples, n) [rad, rad/s, rad/s²]."""
    count, n = q.shape
    turns, inertias = np.empty((n, 3, 3)), np.empty((n, 3, 3))
    origins, axes, coms = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    found = np.empty((count, n))
    for k in range(count):
        pose(bodies, q[k], turns, origins, axes, coms, inertias)
        inverse(bodies, origins, axes, coms, inertias, qd[k], qdd[k], found[k])
    return found


@compiled
def inertias_along(bodies, q):
    """Mass matrices (n_samples, n, n) [kg·m²] along positions (n_samples, n)."""
    count, n = q.shape
    turns, inertias = np.empty((n, 3, 3)), np.empty((n, 3, 3))
    origins, axes, coms = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    found = np.empty((count, n, n))
    for k in range(count):
        pose(bodies, q[k], turns, origins, axes, coms, inertias)
        mass_matrix(bodies, origins, axes, coms, inertias, found[k])
    return found
