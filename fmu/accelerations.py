"""Accelerations of an arm under drives, friction, springs and a rig: Newton's method, written out."""

from dataclasses import dataclass

import casadi as ca

from .base import Base
from .rigid_arm import RigidArm
from .symbolic import solved_symmetric

_NEWTON = 6  # friction in proportion to |load| is piecewise linear: it is met after two or three


@dataclass(frozen=True)
class JointForces:
    """Forces at the J joints.

    Parameters
    ----------
    friction : casadi.Function
        Of accelerations, loads (J,) and ``free`` symbols: torque taken of the drives (J,), and its slopes (J, J) each.
    free : list of casadi.SX
    linear : bool
        Whether friction is linear in accelerations and loads.
    across : bool
        Whether some of it acts along several joints at once.
    on_rig, drive, springs : casadi.SX (J,)
        Torque that a rig takes, that drives give, and of springs.
    springy : tuple of int
        Joints behind a spring.
    """

    friction: ca.Function
    free: list[ca.SX]
    linear: bool
    across: bool
    on_rig: ca.SX
    drive: ca.SX
    springs: ca.SX
    springy: tuple[int, ...]


def accelerations_of(now: RigidArm, on_base: Base, joints: JointForces) -> tuple[ca.SX, ca.SX]:
    """Accelerations (base and J,) and rigid-body torque (J,)."""
    size, base = now.inertia.shape[0], on_base.size
    n = size - base
    at_base = ca.SX.sym("acceleration", base)
    given = on_base.wrench(at_base)
    by_base = ca.jacobian(given, at_base)
    steps = 1 if joints.linear and not any(ca.which_depends(given, at_base, 2, False)) else _NEWTON
    found = ca.SX(size, 1)
    for _ in range(steps):
        force = now.inertia @ found + now.terms
        load = force[base:]
        taken, by_qdd, by_load = joints.friction(found[base:], load, *joints.free)
        residual, matrix = ca.SX(force), ca.SX(now.inertia)
        if base:
            here = ca.densify(found[:base])
            residual[:base] -= ca.substitute(given, at_base, here)
            matrix[:base, :base] -= ca.substitute(by_base, at_base, here)
        if joints.across:
            # Friction in proportion to the load of an axis ties its joints: (1 + d friction / d load) is no diagonal.
            tied = not by_load.is_zero()
            share = ca.inv(ca.SX.eye(n) + by_load) if tied else ca.SX.eye(n)
            residual[base:] = share @ (load + joints.on_rig + taken - joints.drive)
            matrix[base:, base:] += share @ by_qdd
            found = found - (ca.solve(matrix, residual) if tied else solved_symmetric(matrix, residual))
            continue
        for j in range(n):
            if j in joints.springy:
                residual[base + j] = load[j] + joints.on_rig[j] - joints.springs[j]
            else:
                own = load[j] + joints.on_rig[j] + taken[j] - joints.drive[j]
                residual[base + j] = own / (1 + by_load[j, j])
                matrix[base + j, base + j] += by_qdd[j, j] / (1 + by_load[j, j])
        found = found - solved_symmetric(matrix, residual)
    return found, now.inertia[base:, :] @ found + now.terms[base:]
