"""What three balls in V-grooves do by statics: shares, stiffness, jamming; and how one contact bounces.

γ is the flank's angle to the axis, φ = arctan μ. Normal forces alone carry an axial preload P in equal shares.
"""

from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..inertia import Array
from .contact import damping_number
from .groove import BALLS, axes
from .parameters import DockingParameters


def seated_share(preload: float, flank: float) -> float:
    """Normal force of each flank [N]: P/(6 sin γ)."""
    return preload / (6 * np.sin(flank))


def seated_stiffness(p: DockingParameters) -> Array:
    """Stiffness of the frictionless seat against axial [N/m], lateral [N/m], roll and tilt [N·m/rad], shape (4,).

    k (6 sin²γ, 3 cos²γ, 6 R² cos²γ, 3 R² sin²γ); tilt about an axis in the balls' plane.
    """
    s, c, r = np.sin(p.flank), np.cos(p.flank), p.radius
    return p.stiffness * np.array([6 * s * s, 3 * c * c, 6 * r * r * c * c, 3 * r * r * s * s])


def flank_ratio(flank: float, friction: float) -> float:
    """Lateral over axial force at which a ball stands that slides on one flank: cot(γ + φ); from 0 down it blocks."""
    return float(1 / np.tan(flank + np.arctan(friction)))


def contact_wrenches(p: DockingParameters) -> tuple[Array, Array]:
    """Unit wrenches on the end effector about the balls' middle of n and both tangents: (6, 6), (6, 2, 6).

    In the order of the mechanism's contacts.
    """
    normals, tangents = [], []
    s, c = np.sin(p.flank), np.cos(p.flank)
    for ball in range(BALLS):
        axial, lateral, radial = axes(ball)
        arm = p.radius * radial
        for side in (1.0, -1.0):
            n, across = -s * axial - side * c * lateral, side * c * axial - s * lateral
            normals.append(np.concatenate([n, np.cross(arm, n)]))
            tangents.append([np.concatenate([t, np.cross(arm, t)]) for t in (radial, across)])
    return np.array(normals), np.array(tangents)


def closing_twist(p: DockingParameters, missing: int) -> Array:
    """Unit twist (6,) about the balls' middle that keeps the five other contacts and closes the missing one."""
    normals, _ = contact_wrenches(p)
    twist = np.linalg.svd(np.delete(normals, missing, axis=0))[2][-1]
    return -twist if normals[missing] @ twist > 0 else twist


def drive(p: DockingParameters, friction: float, missing: int = 5) -> float:
    """What is left of a unit axial push to move the balls into their seat while five contacts slide; negative: jammed.

    Friction at each contact opposes what the closing twist makes it slide; six equations then give the five normal
    forces and the generalised force along the twist.
    """
    normals, tangents = contact_wrenches(p)
    twist = closing_twist(p, missing)
    columns = []
    for i in range(len(normals)):
        if i != missing:
            slip = tangents[i] @ twist
            columns.append(normals[i] - friction * (slip / np.linalg.norm(slip)) @ tangents[i])
    push = np.array([1.0, 0, 0, 0, 0, 0])
    return float(np.linalg.solve(np.column_stack([*columns, -twist]), -push)[-1])


def jamming_friction(flank: float) -> float:
    """Friction above which five sliding contacts jam; compare Hale and Slocum (Precision Engineering 25, 2001)."""
    p = DockingParameters(flank=flank)
    found: Any = brentq(lambda friction: drive(p, friction), 0.0, 1.0)
    return float(found)


def bounce(mass: float, stiffness: float, damping: float, speed: float) -> tuple[float, float]:
    """Restitution, and peak force [N], of a mass that hits one contact of Hunt and Crossley's law at a speed.

    With y = 1 + D δ̇ the law integrates to ½ k δ²/m = (v − δ̇)/D − ln((1 + D v)/y)/D².
    """
    d = damping

    def overlap(rate: float) -> float:
        gone = (speed - rate) / d - np.log((1 + d * speed) / (1 + d * rate)) / d**2
        return float(np.sqrt(max(2 * mass / stiffness * gone, 0.0)))

    z = d * speed
    found: Any = brentq(lambda e: np.log((1 + z) / (1 - e * z)) - z * (1 + e), 0.0, min(1.0, (1 - 1e-12) / z))
    peak: Any = minimize_scalar(
        lambda rate: -stiffness * overlap(rate) * (1 + d * rate),
        bounds=(0.0, speed),
        method="bounded",
        options={"xatol": 1e-9 * speed},
    )
    return float(found), float(-peak.fun)


def damping_of(p: DockingParameters) -> float:
    """D of the contacts' law [s/m]."""
    return damping_number(p.restitution) / p.restitution_speed
