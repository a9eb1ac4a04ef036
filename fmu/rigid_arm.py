"""Rigid-body dynamics of a model's arm on its base as expressions, and the motion of its bodies as outputs."""

from dataclasses import dataclass

import casadi as ca

from ..models.floating.arm import FloatingArm
from ..models.floating.symbols import Tip, by_base, tip
from ..models.rig.rig import Rig
from ..models.rigid_body import symbolic_torque
from ..models.rotation import quaternion_of
from ..models.tree import Tree
from ..recordings.signals import QUATERNION
from .base import Base
from .base_motion import carried_turning
from .equations import Ledger


@dataclass(frozen=True, eq=False)
class RigidArm:
    """Inertia M (N, N), terms c (N,) [N·m; N at a slide], and the tip, at a state.

    N counts the tree's joints, of which the first six carry a floating base.
    """

    inertia: ca.SX
    terms: ca.SX
    tip: Tip


def rigid(
    tree: Tree,
    arm: FloatingArm,
    phi: ca.SX,
    q: ca.SX,
    qd: ca.SX,
    base: Base | None = None,
    at_tip: ca.SX | None = None,
) -> RigidArm:
    """M and c at a state: M times accelerations plus c is what drives, and what effects do, must add up to.

    Parameters
    ----------
    tree : Tree
        Base and arm, its leading joints the base's carriers where it floats; a `Rig` with its slings in balance.
    arm : FloatingArm
        The same, for its tip.
    phi : casadi.SX
        Inertial parameters of all the tree's links.
    q, qd : casadi.SX (J,)
        Of the arm's joints [rad, rad/s; m, m/s].
    base : Base or None
        Where the base is and what acts on it; None: at rest at the world's origin.
    at_tip : casadi.SX (6,) or None
        Force and moment from outside on the tip, in the world frame [N, N·m].
    """
    size = tree.n_joints
    n_base = size - q.numel()
    turn = ca.SX.eye(3) if base is None else base.turn
    twist = ca.SX(6, 1) if base is None else base.twist
    steady = ca.vertcat(ca.SX(3, 1), carried_turning(twist[3:]))[:n_base]
    position, none = ca.vertcat(ca.SX(n_base, 1), q), ca.SX(size, 1)
    velocity, second = ca.vertcat(twist[:n_base], qd), ca.vertcat(steady, ca.SX(q.numel(), 1))
    gravity = turn.T @ ca.SX(ca.DM(tree.gravity))
    terms = symbolic_torque(tree, position, velocity, second, gravity, phi)
    acceleration = ca.SX.sym("a", size)
    inertia = ca.jacobian(symbolic_torque(tree, position, none, acceleration, ca.SX(3, 1), phi), acceleration)
    end = tip(arm, q)
    if at_tip is not None:
        wrench = ca.vertcat(turn.T @ at_tip[:3], turn.T @ at_tip[3:])
        terms = terms - ca.vertcat(end.by_base.T @ wrench if n_base else ca.SX(0, 1), end.by_joints.T @ wrench)
    if isinstance(tree, Rig):  # slings in balance take the weight that the model's nominal masses have
        terms = terms - symbolic_torque(tree, position, none, none, gravity, ca.SX(tree.phi))
    if base is not None and n_base:
        terms = terms - ca.vertcat(base.given, ca.SX(q.numel(), 1))
    return RigidArm(inertia, terms, end)


def body_outputs(ledger: Ledger, arm: FloatingArm, base: Base, end: Tip, qd: ca.SX) -> None:
    """Pose and twist of the tip, and of a floating base and its mount, in the world frame."""
    place, turn = base.pose[:3], base.turn
    rate = end.by_base @ base.twist + end.by_joints @ qd
    bodies = [("tip", place + turn @ end.translation, quaternion_of(turn @ end.rotation), rate)]
    if arm.floating:
        bodies.append(("base", place, base.pose[3:] / ca.norm_2(base.pose[3:]), base.twist))
    if arm.floating and arm.mount is not None:
        rotation, point = (ca.SX(ca.DM(x)) for x in arm.mount)
        bodies.append(("mount", place + turn @ point, quaternion_of(turn @ rotation), by_base(point) @ base.twist))
    for body, position, quaternion, motion in bodies:
        ledger.vector(f"pos.{body}", "m", position, f"position of {body} in the world frame")
        words = f"attitude of {body} in the world frame (quaternion)"
        ledger.vector(f"quat.{body}", "1", quaternion, words, QUATERNION)
        ledger.vector(f"vel.{body}", "m/s", turn @ motion[:3], f"velocity of {body} in the world frame")
        ledger.vector(f"omega.{body}", "rad/s", turn @ motion[3:], f"angular velocity of {body} in the world frame")
