"""Where a ball is against its V-groove: distance and normal on both flanks, with edge and land outside.

A groove runs along a radius; what counts is the ball's centre in the plane across it: x along the axis, y along the
circle, both from where the centre sits in the groove. The flank on the side of +y is the line x sin γ + y cos γ = 0, γ
being its angle to the axis; it ends at y = w, where the land begins, x = −w/tan γ. Their edge is rounded with radius ρ:
flank and land are set back by ρ, and the distance to the wedge they then bound is taken, less ρ. The other flank is the
mirror image. Along the groove nothing ends.
"""

import casadi as ca
import numpy as np

from ..inertia import Array

BALLS = 3
AZIMUTHS = np.pi / 2 + 2 * np.pi / 3 * np.arange(BALLS)
"""Of the balls about the axis, from y towards z [rad]."""


def axes(ball: int) -> tuple[Array, Array, Array]:
    """Axial, tangential and radial unit vector (3,) of a ball's groove in the target's frame."""
    a = float(AZIMUTHS[ball])
    return np.array([1.0, 0, 0]), np.array([0, -np.sin(a), np.cos(a)]), np.array([0, np.cos(a), np.sin(a)])


def flank(x: ca.SX, y: ca.SX, angle: ca.SX, half_width: ca.SX, edge: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Gap to the flank of +y and its land [m], and the outward normal's x and y.

    Parameters
    ----------
    x, y : SX
        The ball's centre from its seat [m].
    angle, half_width, edge : SX
        γ [rad], w and ρ [m].
    """
    s, c = ca.sin(angle), ca.cos(angle)
    by_flank, by_land = edge - s * x - c * y, edge - (x + half_width * c / s)
    # The corner of the lines that are set back: x_v = ρ − w/tan γ, and on the flank's line s x + c y = ρ.
    corner_x = edge - half_width * c / s
    corner_y = (edge - s * corner_x) / c
    dx, dy = x - corner_x, y - corner_y
    away = ca.sqrt(dx * dx + dy * dy + 1e-24)
    on_flank, on_land = c * dx - s * dy >= 0, dy >= 0
    inside = ca.logic_and(by_flank <= 0, by_land <= 0)
    flat = ca.if_else(inside, by_flank >= by_land, ca.logic_and(on_flank, by_flank > 0))
    landed = ca.if_else(inside, by_flank < by_land, ca.logic_and(on_land, by_land > 0))
    gap = ca.if_else(flat, by_flank, ca.if_else(landed, by_land, away)) - edge
    nx = ca.if_else(flat, -s, ca.if_else(landed, -1.0, dx / away))
    ny = ca.if_else(flat, -c, ca.if_else(landed, 0.0, dy / away))
    return gap, nx, ny
