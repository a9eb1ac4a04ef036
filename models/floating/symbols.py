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
from .arm import FloatingArm


class Tip(NamedTuple):
    """Pose of the tip on the base, and its Jacobians (6, 6) and (6, J): linear rows first."""

    rotation: ca.SX
    translation: ca.SX
    by_base: ca.SX
    by_joints: ca.SX


def turn(axis: ca.DM, angle: ca.SX) -> ca.SX:
    """Rotation matrix (3, 3) about a unit axis (Rodrigues)."""
    along = axis @ axis.T
    return ca.cos(angle) * (ca.DM.eye(3) - along) + ca.sin(angle) * ca.skew(axis) + along


def rotation_of(quaternion: ca.SX) -> ca.SX:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z); base to world."""
    unit = quaternion / ca.norm_2(quaternion)
    w, vector = unit[0], unit[1:]
    cross = ca.skew(vector)
    return ca.SX.eye(3) + 2 * w * cross + 2 * cross @ cross


def quaternion_rate(quaternion: ca.SX, spin: ca.SX) -> ca.SX:
    """Rate (4,) of a quaternion (w, x, y, z) at the angular velocity ``spin`` (3,) in the turning frame [rad/s]."""
    w, vector = quaternion[0], quaternion[1:]
    return 0.5 * ca.vertcat(-ca.dot(vector, spin), w * spin + ca.cross(vector, spin))


def poses(arm: FloatingArm, q: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Rotation (3, 3) and translation (3,) of each link's frame in the base's, at joint positions q (J,)."""
    found: list[tuple[ca.SX, ca.SX]] = []
    for i, joint in enumerate(arm.tree.joints):
        turned, origin = (ca.SX.eye(3), ca.SX(3, 1)) if joint.parent < 0 else found[joint.parent]
        origin = origin + turned @ ca.DM(joint.translation)
        turned = turned @ ca.DM(joint.rotation)
        if joint.kind == "revolute":
            found.append((turned @ turn(ca.DM(joint.axis), q[i]), origin))
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


def quaternion_of(rotation: ca.SX) -> ca.SX:
    """Quaternion (w, x, y, z), w >= 0, of a rotation matrix: the best scaled row of Bar-Itzhack's (2000) matrix."""
    r = rotation
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    rows = [
        ca.vertcat(1 + trace, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]),
        ca.vertcat(r[2, 1] - r[1, 2], 1 + 2 * r[0, 0] - trace, r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        ca.vertcat(r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 + 2 * r[1, 1] - trace, r[1, 2] + r[2, 1]),
        ca.vertcat(r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 + 2 * r[2, 2] - trace),
    ]
    best, size = rows[0], rows[0][0]
    for i in (1, 2, 3):
        larger = rows[i][i] > size
        best, size = ca.if_else(larger, rows[i], best), ca.if_else(larger, rows[i][i], size)
    return best / ca.norm_2(best) * ca.if_else(best[0] < 0, -1, 1)
