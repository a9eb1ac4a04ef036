"""Load-dependent friction: a level in proportion to the torque that the gear carries.

The load is the model's rigid-body torque, never the measured one: a measured torque carries the disturbance and would
make this law explain everything.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["coefficient"] * ca.fabs(s["load"]) * direction(s)


EFFECT = Effect(
    name="load_dependent_friction",
    family="joint friction",
    at="joint",
    sentence="friction that grows with the torque the gear carries",
    equation="coefficient * |load| * sgn(qd)",
    source="Duclusaud et al. (2025)",
    parameters=(Parameter("coefficient", "1", "share of the load lost to friction", low=0.0),),
    law=_law,
    dissipates=True,
    experiment="repeat one motion of {at} at the same speed with two payloads, or in two postures of different "
    "gravity torque",
)
