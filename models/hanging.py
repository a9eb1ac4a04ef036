"""What holds a target on the ground: a line with a spring from its hang point to a fixed point above, its weight, and
a cradle that holds its attitude.

With p the hang point, t the line's top, k and l₀ its stiffness and free length, c the centre of mass, θ the rotation
vector since the start, ω the target's angular velocity, κ and d the cradle's stiffness and damping:

    F = −k (|p − t| − l₀) (p − t)/|p − t| + m g,    M = −κ θ − d ω,    V = k (|p − t| − l₀)²/2 − m g·c + κ |θ|²/2.

The line is stretched by the weight at the start, so that the target rests there (see `Target`). −κ θ is the slope
of its energy: the rate of |θ|²/2 is θ·ω.
"""

import casadi as ca
import numpy as np

from ..errors import InputError
from .rotation import quaternion_of, rotation_of
from .snare.target import Target

CRADLE = 600.0
"""About every axis [N·m/rad], chosen: the soft capture's 10 N at the pin turn it by half a degree, a docking's hundreds
turn it into its seat."""
CRADLE_DAMPING = 40.0
"""Of the same [N·m·s/rad], chosen: critical for the paper's 25 kg as a cube of 0.4 m."""


def hanging_wrench(target: Target, foot: ca.SX, turn: ca.SX, spin: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Wrench (6,) of line, weight and cradle on the target about its foot, in the world [N, N·m], their energy [J], and
    the power that the cradle takes [W].

    Parameters
    ----------
    target : Target
        Of support ``spring``, with an inertia.
    foot, turn, spin : SX (3,), (3, 3), (3,)
        Where its foot is [m], its axes, and its angular velocity in the world [rad/s].

    Raises
    ------
    InputError
        For another support, a target that does not turn, or a line with damping, play or an umbilical beside it.
    """
    if target.support != "spring" or target.inertia is None:
        raise InputError(
            f"docking: a target of support '{target.support}' and inertia {target.inertia} cannot find its seat on the "
            "ground; give support 'spring', and an inertia [kg*m**2]"
        )
    for name in ("damping", "clearance", "umbilical"):
        if getattr(target, name):
            raise InputError(f"docking: a hung target's {name} is {getattr(target, name):g}; give 0")
    weight = target.mass * np.array(target.gravity)
    pull = float(np.linalg.norm(weight))
    start = np.asarray(ca.DM(ca.evalf(rotation_of(ca.SX(list(target.orientation))))))
    top = np.array(target.position) + start @ np.array(target.hang_point) - target.line_length * weight / pull
    free = target.line_length - pull / target.stiffness
    arm, centre = turn @ ca.DM(list(target.hang_point)), turn @ ca.DM(list(target.centre_of_mass))
    line = foot + arm - ca.DM(top)
    length = ca.norm_2(line)
    on = -target.stiffness * (length - free) / length * line
    energy = 0.5 * target.stiffness * (length - free) ** 2 - ca.dot(ca.DM(weight), foot + centre)
    turned = rotation_vector(turn @ ca.DM(start.T))
    about = ca.cross(arm, on) + ca.cross(centre, ca.DM(weight)) - CRADLE * turned - CRADLE_DAMPING * spin
    energy += 0.5 * CRADLE * ca.dot(turned, turned)
    return ca.vertcat(on + ca.DM(weight), about), energy, CRADLE_DAMPING * ca.dot(spin, spin)


def rotation_vector(turn: ca.SX) -> ca.SX:
    """Of a rotation (3, 3) by less than half a turn (3,) [rad]."""
    w, x, y, z = ca.vertsplit(quaternion_of(turn))
    vector = ca.vertcat(x, y, z)
    size = ca.sqrt(ca.dot(vector, vector) + 1e-30)
    return 2 * ca.atan2(size, w) / size * vector
