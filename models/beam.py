"""Links that are elastic along their length: virtual joints at the far end, and what they do to the joints' torques.

A beam is a link that carries one joint some way from its own. It is cut where that joint sits, and joined again by
three virtual joints that stand at zero: a turn about its length (torsion), and two across it (bending). Torques of the
tree with them (recursive Newton-Euler) are the moment that the beam transmits; their derivatives are what the arm's
joints feel of a small turn, of its rate and of its acceleration (Book 1984, for small deflections).
Letters: n samples, J joints, L links, q position, qd, qdd its derivatives, phi inertial parameters (10 * L,).
"""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from .compiled import SampleFunction
from .inertia import Array
from .rigid_body import symbolic_torque
from .tree import Joint, Link, Tree

TURNS = 3
"""Axes of a beam: its length, then two across it."""

_WORDS = ("torsion", "bending1", "bending2")


class BeamTerms(NamedTuple):
    """A beam along samples; the last axis is that of its turns.

    Parameters
    ----------
    moment : array (n, 3)
        What the beam transmits to all beyond its far end, about its length and both axes across [N·m].
    inertia : array (n, 3, 3)
        Of all beyond, about the same axes through the far end, the arm's joints held [kg·m²].
    by_turn, by_rate, by_acceleration : array (n, J, 3)
        Derivative of the joints' torques by the turn of the far end [rad], its rate and its acceleration.
    """

    moment: Array
    inertia: Array
    by_turn: Array
    by_rate: Array
    by_acceleration: Array


def beams(tree: Tree) -> tuple[str, ...]:
    """Links of the arm that have a length and carry one joint; none where slings carry the weight (`booms`)."""
    if tree.balanced:
        return ()
    found = []
    for i in range(tree.carriers, tree.n_joints):
        outboard = [joint for joint, *_ in tree.bodies if joint.parent == i]
        if len(outboard) == 1 and np.linalg.norm(outboard[0].translation) > 1e-6 and outboard[0] in tree.joints:
            found.append(tree.links[i].name)
    return tuple(found)


def carried_joint(tree: Tree, link: int) -> int:
    """Index of the joint at a beam's far end; raises StopIteration where the link carries none."""
    return next(i for i, joint in enumerate(tree.joints) if joint.parent == link)


def length_axes(end: Array) -> Array:
    """Axes of a beam (3, 3) by columns in its link's frame, of its far end (3,) [m]: along it, and two across."""
    along: Array = end / np.linalg.norm(end)
    across = np.asarray(np.cross(along, np.eye(3)[np.argmin(np.abs(along))]), float)
    across = across / float(np.linalg.norm(across))
    return np.stack([along, across, np.cross(along, across)], axis=1)


def cut(tree: Tree, link: int, about: tuple[int, ...] = (0, 1, 2)) -> Tree:
    """The tree with virtual joints at a link's far end, about some of its axes, and a massless link behind each.

    They have the numbers from ``link + 1`` on, and are named ``<link>.torsion``, ``.bending1`` and ``.bending2``.

    Raises
    ------
    StopIteration
        Where the link carries no joint.
    """
    end = tree.joints[carried_joint(tree, link)].translation
    axes, more, eye = length_axes(end), len(about), np.eye(3)
    name = tree.links[link].name
    virtual = [
        Joint(f"{name}.{_WORDS[a]}", "revolute", eye[a], link + k, eye if k else axes, np.zeros(3) if k else end)
        for k, a in enumerate(about)
    ]

    def moved(joint: Joint) -> Joint:
        if joint.parent == link:
            pose = axes.T @ joint.rotation, axes.T @ (joint.translation - end)
            return replace(joint, parent=link + more, rotation=pose[0], translation=pose[1])
        return joint if joint.parent < link else replace(joint, parent=joint.parent + more)

    joints = [moved(joint) for joint in tree.joints]
    followers = tuple(
        replace(f, joint=moved(f.joint), leader=f.leader + more * (f.leader > link)) for f in tree.followers
    )
    none = [Link(joint.name, np.zeros(10)) for joint in virtual]
    return Tree(
        tree.name,
        (*joints[: link + 1], *virtual, *joints[link + 1 :]),
        (*tree.links[: link + 1], *none, *tree.links[link + 1 :]),
        tree.gravity,
        followers=followers,
        axes=tree.axes,
    )


def beam_terms(tree: Tree, link: int, q: Array, qd: Array, qdd: Array) -> BeamTerms:
    """A link as a beam along a motion, each (n, J), at the tree's own gravity and inertial parameters."""
    moment, *rest = _compiled(tree, link)(q, qd, qdd, tree.gravity, tree.phi)
    return BeamTerms(moment[:, :, 0], *rest)


def symbolic_beam(tree: Tree, link: int, motion: tuple[ca.SX, ca.SX, ca.SX], gravity: ca.SX, phi: ca.SX) -> list[ca.SX]:
    """`BeamTerms` of one instant in CasADi symbols, for ``motion`` q, qd, qdd, each (J,)."""
    whole, n = cut(tree, link), tree.n_joints
    turns = [ca.SX.sym(name, TURNS) for name in ("turn", "rate", "second")]
    q, qd, qdd = (ca.vertcat(x[: link + 1], turn, x[link + 1 :]) for x, turn in zip(motion, turns, strict=True))
    at = 10 * (link + 1)
    torque = symbolic_torque(whole, q, qd, qdd, gravity, ca.vertcat(phi[:at], ca.SX.zeros(10 * TURNS), phi[at:]))
    own = torque[link + 1 : link + 1 + TURNS]
    joints = ca.vertcat(torque[: link + 1], torque[link + 1 + TURNS : n + TURNS])
    found = [own, ca.jacobian(own, turns[2]), *(ca.jacobian(joints, turn) for turn in turns)]
    standing = ca.SX.zeros(TURNS * len(turns))
    return [ca.substitute(x, ca.vertcat(*turns), standing) for x in found]


@cache
def _compiled(tree: Tree, link: int) -> SampleFunction:
    """(q, qd, qdd, gravity, phi) -> moment, inertia, and the derivatives of the joints' torques."""
    sizes = {"q": tree.n_joints, "qd": tree.n_joints, "qdd": tree.n_joints, "gravity": 3, "phi": 10 * len(tree.links)}
    q, qd, qdd, gravity, phi = symbols = [ca.SX.sym(name, size) for name, size in sizes.items()]
    return SampleFunction(ca.Function("beam", symbols, ca.cse(symbolic_beam(tree, link, (q, qd, qdd), gravity, phi))))
