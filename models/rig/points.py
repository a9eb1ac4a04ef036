"""Points of a tree's links along samples: where they are, how they move, and how a force there reaches the joints.

Letters: n samples, J joints. Points are given in a link's frame; what is found of them is in the world frame.
"""

from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..compiled import SampleFunction
from ..inertia import Array, to_central
from ..tree import Tree


class PointMotion(NamedTuple):
    """A point fixed on a link, along samples.

    Parameters
    ----------
    jacobian : array (n, 6, J)
        Velocity of the point, then turning rate of its link, per joint rate, both in the world frame.
    position, velocity : array (n, 3)
        [m, m/s]
    rotation : array (n, 3, 3)
        Link's frame to the world.
    """

    jacobian: Array
    position: Array
    velocity: Array
    rotation: Array


def point_motion(tree: Tree, link: int, point: Array, q: Array, qd: Array) -> PointMotion:
    """Motion of a point (3,) [m] given in a link's frame, for q, qd (n, J)."""
    pick = np.zeros(tree.n_joints)
    pick[link] = 1.0
    jacobian, position, velocity, rotation = _kinematics(tree)(q, qd, pick, np.asarray(point, float))
    return PointMotion(jacobian, position[:, :, 0], velocity[:, :, 0], rotation)


def far_end(tree: Tree, link: int) -> Array:
    """A link's far end (3,) [m] in its frame: the next joint's origin, or the centre of mass where there is none."""
    outboard = [joint.translation for joint in tree.joints if joint.parent == link]
    return outboard[0] if outboard else to_central(tree.links[link].phi)[1]


def symbolic_point(tree: Tree, q: ca.SX, pick: ca.SX, point: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Jacobian (6, J), position (3,) and link's rotation (3, 3) of a point (3,) on the link where ``pick`` (J,) is 1.

    As in `PointMotion`, in CasADi symbols; ``pick`` is zero at all other links.
    """
    n = tree.n_joints
    origins, rotations, axes = [], [], []
    position, rotation, moved = ca.SX(3, 1), ca.SX(3, 3), ca.SX(n, 1)
    paths: list[set[int]] = []  # joints that move each link
    for i, joint in enumerate(tree.joints):
        base, turned = ca.SX(3, 1), ca.SX.eye(3)
        if joint.parent >= 0:
            base, turned = origins[joint.parent], rotations[joint.parent]
        frame = turned @ ca.DM(joint.rotation)
        origin, axis = base + turned @ ca.DM(joint.translation), frame @ ca.DM(joint.axis)
        if joint.kind == "revolute":
            along = np.outer(joint.axis, joint.axis)
            turn = ca.cos(q[i]) * ca.DM(np.eye(3) - along) + ca.sin(q[i]) * ca.skew(ca.DM(joint.axis)) + ca.DM(along)
            frame = frame @ turn
        else:
            origin = origin + axis * q[i]
        origins.append(origin)
        rotations.append(frame)
        axes.append(axis)
        paths.append({i} | (paths[joint.parent] if joint.parent >= 0 else set()))
        position += pick[i] * (origin + frame @ point)
        rotation += pick[i] * frame
        for j in paths[i]:
            moved[j] += pick[i]
    jacobian = ca.SX(6, n)
    for j, joint in enumerate(tree.joints):
        turn = joint.kind == "revolute"
        jacobian[:3, j] = moved[j] * (ca.cross(axes[j], position - origins[j]) if turn else axes[j])
        jacobian[3:, j] = moved[j] * axes[j] if turn else ca.SX(3, 1)
    return jacobian, position, rotation


@cache
def _kinematics(tree: Tree) -> SampleFunction:
    """(q, qd, pick, point) -> Jacobian, position, velocity, rotation."""
    n = tree.n_joints
    q, qd, pick, point = (ca.SX.sym(name, size) for name, size in (("q", n), ("qd", n), ("pick", n), ("point", 3)))
    jacobian, position, rotation = symbolic_point(tree, q, pick, point)
    outputs: list[ca.SX] = [jacobian, position, jacobian[:3, :] @ qd, rotation]
    return SampleFunction(ca.Function("point_motion", [q, qd, pick, point], ca.cse(outputs)))
