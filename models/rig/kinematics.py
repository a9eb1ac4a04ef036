"""How forces at a rig's hang points, slides and booms reach its joints, over many samples.

Letters: n samples, J joints. A map has shape (n, J, m): it takes the m numbers that an effect's law gives at a place to
the torque that every drive must add. Forces and points are in the world frame.
"""

from functools import cache

import numpy as np

from ..inertia import Array
from .points import far_end, point_motion
from .rig import Rig, Sling


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


def suspension_map(rig: Rig, q: Array) -> Array:
    """Drive torque per stiffness of all slings (n, J, 1) [m² or m]: each pulls by that times the rise of its hang
    point less, since all joints were at zero."""
    total, zero = np.zeros((len(q), rig.n_joints, 1)), np.zeros((1, rig.n_joints))
    for sling in rig.slings:
        held = point_motion(rig, sling.link, sling.point, q, np.zeros_like(q))
        level = point_motion(rig, sling.link, sling.point, zero, zero).position[0, 2]
        total[:, :, 0] += held.jacobian[:, 2] * (held.position[:, 2] - level)[:, None]
    return total


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


SUSPENSION = "slings"
"""The place of what all slings do alike."""


def places_of(rig: Rig, kind: str) -> tuple[str, ...]:
    """Names of all places of a kind that only a rig has; none of any other kind."""
    found = {
        "sling": lambda: tuple(s.name for s in rig.slings),
        "slide": lambda: slides(rig),
        "boom": lambda: booms(rig),
        "suspension": lambda: (SUSPENSION,),
    }
    return found[kind]() if kind in found else ()


def place_map(rig: Rig, kind: str, at: str, q: Array) -> Array:
    """The map (n, J, m) of a sling, a slide, a boom or the whole suspension, by its name."""
    if kind == "sling":
        return sling_map(rig, sling_of(rig, at), q)
    if kind == "slide":
        return slide_map(rig, [joint.name for joint in rig.joints].index(at), q)
    if kind == "suspension":
        return suspension_map(rig, q)
    return boom_map(rig, [link.name for link in rig.links].index(at), q)[0]


@cache
def reached_joints(rig: Rig, kind: str, at: str, rows: tuple[int, ...]) -> tuple[int, ...]:
    """Joints that some of the numbers given at a place can turn, in some configuration.

    A vertical force never turns joint 1 of the built-in rig.
    """
    anywhere = np.random.default_rng(0).uniform(-1.0, 1.0, (8, rig.n_joints))
    felt = np.abs(place_map(rig, kind, at, anywhere)[:, :, list(rows)]) > 1e-9
    return tuple(int(c) for c in np.flatnonzero(felt.any(axis=(0, 2))))
