"""The carriage on its ball screw: motor, friction, brake and stops, as the force along its travel s.

    (m + J (2π/l)²) s̈ = F_m − F_cable − F_C tanh(ṡ/v_c) − b ṡ + brake + stops,      F_m = (2πη/l) τ,  |τ| ≤ τ_max,

l being the screw's lead and η its efficiency. The motor follows a travel s_r, which a commanded speed moves on:
F_m = k (s_r − s) + d (u − ṡ), within its limit. A ball screw backdrives, so that a brake holds, with the stiffness of
the screw behind it.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ..effects.carriage_friction import EFFECT as FRICTION
from .parameters import DockingParameters


class Carriage(NamedTuple):
    """Force along s on the carriage besides the cables' [N], the motor's part of it, power that the motor puts in and
    that screw and friction, and brake and stops, take [W]."""

    force: ca.SX
    motor: ca.SX
    put_in: ca.SX
    lost: ca.SX
    held: ca.SX


def reflected_inertia(p: DockingParameters) -> float:
    """J (2π/l)²: what the rotor adds to the carriage's mass [kg]."""
    return p.rotor * (2 * np.pi / p.lead) ** 2


def carriage(
    s: ca.SX, rate: ca.SX, wanted: ca.SX, speed: ca.SX, on: ca.SX, brake: ca.SX, held: ca.SX, p: dict[str, ca.SX]
) -> Carriage:
    """Write the law out: travel, rate, s_r [m], u [m/s], motor on (1) or off, brake on, and the travel it holds [m]."""
    limit = 2 * np.pi * p["efficiency"] / p["lead"] * p["torque_limit"]
    asked = p["drive_stiffness"] * (wanted - s) + p["drive_damping"] * (speed - rate)
    motor = on * ca.fmax(ca.fmin(asked, limit), -limit)
    friction = FRICTION.law(
        {"qd": rate, "slip_velocity": p["coulomb_speed"]}, {"level": p["coulomb"], "viscous": p["viscous"]}
    )
    holding = brake * (p["brake_stiffness"] * (held - s) - p["brake_damping"] * rate)
    stops = ca.SX(0)
    for depth, way in ((-s, 1.0), (s - p["stroke"], -1.0)):
        push = p["stop_stiffness"] * depth - p["stop_damping"] * way * rate
        stops += way * ca.if_else(depth > 0, ca.fmax(push, 0.0), 0.0)
    put_in = motor * rate / p["efficiency"]
    return Carriage(
        motor - friction + holding + stops,
        motor,
        put_in,
        put_in - motor * rate + friction * rate,
        -(holding + stops) * rate,
    )
