"""Balls in grooves and latches between two bodies: what they do to the end effector, seen from the target.

Everything is in the target's frame. Each ball is a point of the end effector; what acts there on the one body acts on
the other, in the same point, the other way round.
"""

from collections.abc import Callable
from typing import NamedTuple

import casadi as ca
import numpy as np

from .contact import Rub, contact, damping_number
from .groove import BALLS, axes, flank
from .parameters import DockingParameters

CONTACTS = 2 * BALLS
BRISTLES = 2 * CONTACTS
HELD = tuple(f"{name}.{i + 1}" for i in range(BALLS) for name in ("x", "y", "z"))
"""Where each ball was as its latch took hold, in the target's frame [m]: inputs of the mechanism."""


class Laws(NamedTuple):
    """What a docking has beside the parameters' own: friction of the flanks in place of theirs; lateral shift [m] of a
    groove by its number; force (3,) [N] on a ball from how far it is drawn from where its latch took hold (3,) [m]."""

    rub: Rub
    shift: Callable[[int], ca.SX]
    latch: Callable[[ca.SX], ca.SX]


class DockingForces(NamedTuple):
    """What the docking does.

    Force (3,) and moment (3,) on the end effector about its origin [N, N·m], of contacts and latches together; rates of
    the bristles (12,); normal forces (6,) [N]; distance of each ball from its seat, axial and lateral (3, 2) [m]; the
    contacts' stored energy [J], powers lost in their damping and friction, and the power that latches take [W]; the
    latches' axial pulls on their balls (3,) [N].
    """

    force: ca.SX
    moment: ca.SX
    bristle_rate: ca.SX
    normal: ca.SX
    off: ca.SX
    stored: ca.SX
    damped: ca.SX
    rubbed: ca.SX
    latched: ca.SX
    grip: ca.SX


def ball_places(p: DockingParameters) -> np.ndarray:
    """Centres (3, 3) of the balls in the end effector's frame [m]."""
    return np.array([p.seat * axes(i)[0] + p.radius * axes(i)[2] for i in range(BALLS)])


def constants(p: DockingParameters) -> dict[str, float]:
    """What `docked` reads of the parameters, D of the contacts' law among it [s/m]."""
    return p.values() | {"damping": damping_number(p.restitution) / p.restitution_speed}


def docked(
    place: ca.SX,
    turn: ca.SX,
    velocity: ca.SX,
    spin: ca.SX,
    bristles: ca.SX,
    engaged: ca.SX,
    held: ca.SX,
    p: dict[str, ca.SX],
    laws: Laws | None = None,
) -> DockingForces:
    """Write the mechanism out.

    Parameters
    ----------
    place, turn : SX (3,), (3, 3)
        The end effector's origin and axes [m].
    velocity, spin : SX (3,)
        Of that origin and about it, as the target sees them [m/s, rad/s].
    bristles : SX (12,)
        [m]
    engaged : SX (3,)
        Share by which each latch holds, 0 to 1.
    held : SX (9,)
        See `HELD`.
    p : dict
        Names of `constants`.
    laws : Laws, optional
        Of effects.
    """
    force, moment = ca.SX(3, 1), ca.SX(3, 1)
    rates, normals, off, grips = [], [], [], []
    stored, damped, rubbed, latched = ca.SX(0), ca.SX(0), ca.SX(0), ca.SX(0)
    for ball in range(BALLS):
        axial, lateral, radial = (ca.DM(axis) for axis in axes(ball))
        arm = turn @ (p["seat"] * axial + p["radius"] * radial)
        centre, speed = place + arm, velocity + ca.cross(spin, arm)
        from_seat = centre - p["radius"] * radial
        x, y = ca.dot(axial, from_seat), ca.dot(lateral, from_seat)
        beside = laws.shift(ball) if laws else ca.SX(0)
        off += [x, y]
        push = ca.SX(3, 1)
        for k, side in enumerate((1.0, -1.0)):
            gap, nx, ny = flank(x, side * (y - beside), p["flank"], p["half_width"], p["edge"])
            normal = nx * axial + side * ny * lateral
            across = -side * ny * axial + nx * lateral
            slip = ca.vertcat(ca.dot(radial, speed), ca.dot(across, speed))
            first = 2 * (2 * ball + k)
            found = contact(gap, -ca.dot(normal, speed), slip, bristles[first : first + 2], p, laws and laws.rub)
            push += found.normal * normal + found.tangential[0] * radial + found.tangential[1] * across
            rates.append(found.rate)
            normals.append(found.normal)
            stored, damped, rubbed = stored + found.stored, damped + found.damped, rubbed + found.rubbed
        drawn = centre - held[3 * ball : 3 * ball + 3]
        pull = p["latch_preload"] * axial - p["latch_stiffness"] * drawn - p["latch_damping"] * speed
        grip = engaged[ball] * (pull + laws.latch(drawn) if laws else pull)
        latched -= ca.dot(grip, speed)
        grips.append(ca.dot(axial, grip))
        push += grip
        force += push
        moment += ca.cross(arm, push)
    return DockingForces(
        force,
        moment,
        ca.vertcat(*rates),
        ca.vertcat(*normals),
        ca.reshape(ca.vertcat(*off), 2, BALLS).T,
        stored,
        damped,
        rubbed,
        latched,
        ca.vertcat(*grips),
    )


def bumped(
    place: ca.SX, turn: ca.SX, velocity: ca.SX, spin: ca.SX, travel: ca.SX, rate: ca.SX, p: dict[str, ca.SX]
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Bumpers of the carriage's front on the target's face, its plane x = 0, without friction.

    Arguments as of `docked`, and the carriage's travel and its rate [m, m/s]. Force and moment (3,) on the carriage
    about its own origin, in the target's frame [N, N·m]; stored energy [J]; power lost [W].
    """
    force, moment, stored, damped = ca.SX(3, 1), ca.SX(3, 1), ca.SX(0), ca.SX(0)
    axial = ca.DM([1.0, 0, 0])
    law = p | {"stiffness": p["bumper_stiffness"], "friction": ca.SX(0)}
    for ball in range(BALLS):
        own = turn @ (p["front"] * axial + p["bumper_radius"] * ca.DM(axes(ball)[2]))
        arm = own - travel * turn[:, 0]
        speed = velocity + ca.cross(spin, arm) - rate * turn[:, 0]
        found = contact(-(place + arm)[0], speed[0], ca.SX(2, 1), ca.SX(2, 1), law)
        push = -found.normal * axial
        force, moment = force + push, moment + ca.cross(own, push)
        stored, damped = stored + found.stored, damped + found.damped
    return force, moment, stored, damped
