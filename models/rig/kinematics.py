"""How forces at a rig's hang points, slides and booms reach its joints, over many samples.

Letters: n samples, J joints. A map has shape (n, J, m): it takes the m numbers that an effect's law gives at a place to
the torque that every drive must add. Forces and points are in the world frame.
"""

from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..compiled import SampleFunction
from ..inertia import Array, to_central
from ..tree import Tree
from .rig import Rig, Sling


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


def sling_map(rig: Rig, sling: Sling, q: Array) -> Array:
    """Drive torque per wrench of a sling on the arm (n, J, 6): -J'; force [N] at the hang point, then moment [N·m]."""
    return -np.swapaxes(point_motion(rig, sling.link, sling.point, q, np.zeros_like(q)).jacobian, 1, 2)


def slide_map(rig: Rig, joint: int, q: Array) -> Array:
    """Drive torque per friction force at the slides that a joint moves (n, J, 1) [N·m/N].

    A contact at h with the slide's tangent t gives t · (e_i x (h - o_i)) on joint i: on the joint itself its radius, on
    every joint before it its moment about that joint's axis (Tian, Tang, Dai and Li, eqs. 13-16, with t for their
    e_i, whose force would turn nothing).
    """
    total = np.zeros((len(q), rig.n_joints, 1))
    for sling in rig.slings:
        for contact in sling.slide if sling.link == joint else ():
            at = point_motion(rig, joint, contact, q, np.zeros_like(q))
            force = at.rotation @ rig.tangent_of(sling, contact)
            total[:, :, 0] += np.einsum("nik,ni->nk", at.jacobian[:, :3], force)
    return total


def boom_map(rig: Rig, link: int, q: Array) -> tuple[Array, Array]:
    """How a boom's deformation presses on the slings beyond it, and how that reaches the drives.

    The far end of the boom turns about its long axis (torsion) or about the horizontal axis across it (bending). A
    sling beyond then moves up by its lever [m] times the angle.

    Returns
    -------
    reach : array (n, J, 2)
        Drive torque per [N/m]: each sling beyond is given that times its lever as upward force.
    spread : array (n, 2)
        Sum of squared levers [m²].
    """
    end = far_end(rig, link)
    tip = point_motion(rig, link, end, q, np.zeros_like(q))
    along = tip.rotation @ (end / np.linalg.norm(end))
    across = np.stack([-along[:, 1], along[:, 0], np.zeros(len(q))], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
    reach, spread = np.zeros((len(q), rig.n_joints, 2)), np.zeros((len(q), 2))
    for sling in rig.outboard(link):
        held = point_motion(rig, sling.link, sling.point, q, np.zeros_like(q))
        arm = held.position - tip.position
        levers = np.stack([np.cross(axis, arm)[:, 2] for axis in (along, across)], axis=1)
        reach -= held.jacobian[:, 2, :, None] * levers[:, None, :]
        spread += levers**2
    return reach, spread


def far_end(tree: Tree, link: int) -> Array:
    """A link's far end (3,) [m] in its frame: the next joint's origin, or the centre of mass where there is none."""
    outboard = [joint.translation for joint in tree.joints if joint.parent == link]
    return outboard[0] if outboard else to_central(tree.links[link].phi)[1]


def booms(rig: Rig) -> tuple[str, ...]:
    """Links that have a length and slings beyond it."""
    return tuple(
        link.name for i, link in enumerate(rig.links) if rig.outboard(i) and np.linalg.norm(far_end(rig, i)) > 1e-6
    )


def slides(rig: Rig) -> tuple[str, ...]:
    """Joints that move a hang unit on its slide."""
    held = {s.link for s in rig.slings if len(s.slide)}
    return tuple(joint.name for i, joint in enumerate(rig.joints) if i in held)


def sling_of(rig: Rig, name: str) -> Sling:
    """The sling of that name."""
    return next(s for s in rig.slings if s.name == name)


def place_map(rig: Rig, kind: str, at: str, q: Array) -> Array:
    """The map (n, J, m) of a sling, a slide or a boom, by its name."""
    if kind == "sling":
        return sling_map(rig, sling_of(rig, at), q)
    if kind == "slide":
        return slide_map(rig, [joint.name for joint in rig.joints].index(at), q)
    return boom_map(rig, [link.name for link in rig.links].index(at), q)[0]


@cache
def reached_joints(rig: Rig, kind: str, at: str, rows: tuple[int, ...]) -> tuple[int, ...]:
    """Joints that some of the numbers given at a place can turn, in some configuration.

    A vertical force never turns joint 1 of the built-in rig.
    """
    anywhere = np.random.default_rng(0).uniform(-1.0, 1.0, (8, rig.n_joints))
    felt = np.abs(place_map(rig, kind, at, anywhere)[:, :, list(rows)]) > 1e-9
    return tuple(int(c) for c in np.flatnonzero(felt.any(axis=(0, 2))))


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
