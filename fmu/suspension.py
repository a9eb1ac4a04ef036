"""A suspension rig's slings, slides and booms as expressions: the signals of their laws, and their torques at the
joints.

The same geometry, over recorded samples, is `snarelab.models.rig.kinematics`; letters as there.
"""

import casadi as ca
import numpy as np

from ..models.inertia import Array
from ..models.model import PlacedEffect
from ..models.rig.kinematics import sling_of
from ..models.rig.points import far_end, symbolic_point
from ..models.rig.rig import Rig

PLACES = ("sling", "slide", "boom", "suspension")
"""Kinds of place that only a rig has."""


def rig_signals(rig: Rig, p: PlacedEffect, q: ca.SX, qd: ca.SX) -> dict[str, ca.SX]:
    """Signals of a law at a sling or a boom, at q, qd (J,); a law at a slide reads its joint's signals."""
    if p.effect.at == "sling":
        sling = sling_of(rig, p.at)
        velocity = _point(rig, sling.link, sling.point, q)[0][:3, :] @ qd
        return {"velocity": velocity, "weight": ca.SX(sling.weight), "tension": ca.SX(sling.tension)}
    if p.effect.at == "boom":
        return {"spread": _boom(rig, p.at, q)[1]}
    return {}


def rig_reach(rig: Rig, p: PlacedEffect, q: ca.SX) -> ca.SX:
    """Torque that every drive must add, per number that the law gives: a matrix (J, m)."""
    if p.effect.at == "sling":
        sling = sling_of(rig, p.at)
        return -_point(rig, sling.link, sling.point, q)[0].T
    if p.effect.at == "boom":
        return _boom(rig, p.at, q)[0]
    if p.effect.at == "suspension":
        return _suspension(rig, q)
    joint = [j.name for j in rig.joints].index(p.at)
    total = ca.SX(rig.n_joints, 1)
    for sling in rig.slings:
        for contact in sling.slide if sling.link == joint else ():
            jacobian, _, rotation = _point(rig, joint, contact, q)
            total += jacobian[:3, :].T @ (rotation @ ca.SX(ca.DM(rig.tangent_of(sling, contact))))
    return total


def _suspension(rig: Rig, q: ca.SX) -> ca.SX:
    """Reach (J, 1) of all slings, as `snarelab.models.rig.kinematics.suspension_map` has it."""
    reach, zero = ca.SX(rig.n_joints, 1), ca.SX.zeros(rig.n_joints)
    for sling in rig.slings:
        jacobian, place, _ = _point(rig, sling.link, sling.point, q)
        reach += jacobian[2, :].T * (place[2] - _point(rig, sling.link, sling.point, zero)[1][2])
    return reach


def _boom(rig: Rig, at: str, q: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Reach (J, 2) and spread (2,) of a boom, as `snarelab.models.rig.kinematics.boom_map` has them."""
    link = [k.name for k in rig.links].index(at)
    end = far_end(rig, link)
    _, tip, rotation = _point(rig, link, end, q)
    along = rotation @ ca.SX(ca.DM(end / np.linalg.norm(end)))
    across = ca.vertcat(-along[1], along[0], 0)
    across = across / ca.fmax(ca.norm_2(across), 1e-9)
    reach, spread = ca.SX(rig.n_joints, 2), ca.SX(2, 1)
    for sling in rig.outboard(link):
        jacobian, place, _ = _point(rig, sling.link, sling.point, q)
        levers = ca.vertcat(*(ca.cross(axis, place - tip)[2] for axis in (along, across)))
        reach -= jacobian[2, :].T @ levers.T
        spread += levers**2
    return reach, spread


def _point(rig: Rig, link: int, point: Array, q: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Jacobian (6, J), position (3,) and link's rotation (3, 3) of a point of a link, in the world frame."""
    pick = ca.SX(ca.DM(np.eye(rig.n_joints)[link]))
    return symbolic_point(rig, q, pick, ca.SX(ca.DM(point)))
