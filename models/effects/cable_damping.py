"""Cable damping: strands rub as a wire rope bends, so that it resists the rate of its curvature.

A model without it has the little damping of the set-up's rope (1 ms): no rope has none.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["time"] * s["bending_stiffness"] * s["curvature_rate"]


EFFECT = Effect(
    name="cable_damping",
    family="snare and contact",
    at="cables",
    sentence="the cables' own vibration decays faster or slower than in the model",
    equation="bending moment time * bending stiffness * rate of the curvature",
    source="Voigt (1892), Kelvin and Voigt's law on curvature",
    parameters=(Parameter("time", "s", "damping over stiffness in bending", low=0.0, high=1.0, grid=(3e-3, 1e-2)),),
    law=_law,
    experiment="pluck {at} with the ring at rest, and watch the swing die out",
)
