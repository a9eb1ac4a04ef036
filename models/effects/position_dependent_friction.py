"""Position-dependent friction: a level that varies along the travel, as with a bent screw or an eccentric gear.

The mean level is Coulomb friction's; this is the variation about it, so that alone it can have either sign. The length
of the wave is a ``period`` in the joint's own unit: 6.283 rad is once per turn of the joint, 0.005 m once per turn of a
screw of 5 mm lead.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    phase = 2 * ca.pi * s["q"] / p["period"]
    return (p["cosine"] * ca.cos(phase) + p["sine"] * ca.sin(phase)) * direction(s)


EFFECT = Effect(
    name="position_dependent_friction",
    family="joint friction",
    at="joint",
    sentence="friction that is higher at some positions than at others",
    equation="(cosine * cos(2*pi*q/period) + sine * sin(2*pi*q/period)) * sgn(qd), on top of Coulomb friction",
    source="Armstrong (1988)",
    parameters=(
        Parameter("cosine", "T", "variation in phase with the cosine of position"),
        Parameter("sine", "T", "variation in phase with the sine of position"),
        # Half a period in the travel apart: a fit from further off locks on to a side lobe.
        Parameter(
            "period",
            "S",
            "travel after which the level repeats",
            zero=1.0,
            low=0.05,
            high=4.0,
            grid=tuple(2 / halves for halves in range(1, 21)),
            relative_to="travel",
        ),
    ),
    law=_law,
    experiment="run {at} slowly to and fro over its whole travel and halve the difference of the torques position "
    "by position",
)
