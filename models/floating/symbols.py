"""Kinematics and dynamics of an arm on a floating base as CasADi expressions, all in the base's frame.

The base's twist is ``(v, w)``: velocity of the base frame's origin and angular velocity, [m/s, rad/s]. The equations of
motion are (Umetani, Yoshida 1989; Wang, Luo, Ma 2011, eq. 8)::

    [H_b    H_bm] [v', w']   [c_b]   [force, moment on the base]
    [H_bm^T H_m ] [ qdd  ] + [c_m] = [          tau            ]

They are the torque of `FloatingArm.whole`, a tree whose first six joints carry the base and stand at zero.
"""

from typing import NamedTuple

import casadi as ca

from ..rigid_body import symbolic_torque
from ..rotation import turn
from .arm import FloatingArm


class Tip(NamedTuple):
    """Pose of the tip on the base, and its Jacobians (6, 6) and (6, J): linear rows first."""

    rotation: ca.SX
    translation: ca.SX
    by_base: ca.SX
    by_joints: ca.SX


def poses(arm: FloatingArm, q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Rotation (3, 3) and translation (3,) of each link's frame in the base's, at joint positions q (J,)."""
    found: list[tuple[ca.SX, ca.SX]] = []
    for i, joint in enumerate(arm.tree.joints):
        turned, origin = (ca.SX.eye(3), ca.SX(3, 1)) if joint.parent < 0 else found[joint.parent]
        origin = origin + turned @ ca.DM(joint.translation)
        turned = turned @ ca.DM(joint.rotation)
        if joint.kind == "revolute":
            found.append((turned @ turn(joint.axis, q[i]), origin))
        else:
            found.append((turned, origin + turned @ ca.DM(joint.axis) * q[i]))
    return found


def tip(arm: FloatingArm, q: ca.SX) -> Tip:
    """Pose and Jacobians of the tip at joint positions q (J,)."""
    frames = poses(arm, q)
    turned, origin = frames[arm.tip_link]
    point = origin + turned @ ca.DM(arm.tip_translation)
    columns = [ca.SX(6, 1) for _ in frames]
    i = arm.tip_link
    while i >= 0:
        joint = arm.tree.joints[i]
        axis, none = frames[i][0] @ ca.DM(joint.axis), ca.SX(3, 1)
        by_turning = ca.vertcat(ca.cross(axis, point - frames[i][1]), axis)
        columns[i] = by_turning if joint.kind == "revolute" else ca.vertcat(axis, none)
        i = joint.parent
    return Tip(turned @ ca.DM(arm.tip_rotation), point, by_base(point), ca.horzcat(*columns))


def by_base(point: ca.SX | ca.DM) -> ca.SX:
    """Twist (6, 6) of a point (3,) per twist of the base that carries it."""
    return ca.blockcat([[ca.SX.eye(3), -ca.skew(ca.SX(point))], [ca.SX(3, 3), ca.SX.eye(3)]])


def inertia(arm: FloatingArm, q: ca.SX) -> ca.SX:
    """Inertia H (6 + J, 6 + J) of base and arm [kg, kg·m, kg·m²]."""
    rates = ca.SX.sym("rates", 6 + arm.n_joints)
    none = ca.SX(6 + arm.n_joints, 1)
    return ca.jacobian(symbolic_torque(arm.whole, _whole(q), none, rates, ca.SX(3, 1), ca.SX(arm.whole.phi)), rates)


def bias(arm: FloatingArm, q: ca.SX, twist: ca.SX, qd: ca.SX, gravity: ca.SX) -> ca.SX:
    """Velocity and gravity terms (c_b, c_m) (6 + J,) [N, N·m]; gravity (3,) in the base's frame [m/s²]."""
    x, y, z = ca.vertsplit(twist[3:])
    # the rates of the three carrying joints are the angular velocity, yet their rates' rates are not its rate:
    # each axis is turned by the joints before it
    still = ca.vertcat(ca.SX(3, 1), y * z, -x * z, x * y)
    rates = ca.vertcat(-still, ca.SX(arm.n_joints, 1))
    return symbolic_torque(arm.whole, _whole(q), ca.vertcat(twist, qd), rates, gravity, ca.SX(arm.whole.phi))


def _whole(q: ca.SX) -> ca.SX:
    return ca.vertcat(ca.SX(6, 1), q)
