"""Flexible appendage: panels that bend to and fro when the base turns, and shake it at their own frequency.

Effective inertia form of one cantilever mode about each axis of the base: inertia = delta², delta the mode's rotational
participation. The base's own inertia, in the model, holds the appendage as if it were rigid. Balanced pairs of panels
in antisymmetric bending have no force on the base; what a lone panel gives at the frame's origin is left out.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._oscillators import DAMPING, FREQUENCY, STATES, rates, second_rates


def _law(s: Symbols, p: Symbols) -> ca.SX:
    bent = second_rates(s, p, s["spin_rate"])
    return ca.vertcat(0, 0, 0, *(-p[f"inertia_{axis}"] * bent[i] for i, axis in enumerate("xyz")))


EFFECT = Effect(
    name="flexible_appendage",
    family="free-floating base",
    at="base",
    sentence="a flexible appendage bends when the base turns, and shakes it at its own frequency",
    equation="moment -inertia * e'' about each axis, e'' + 2 damping w e' + w² e = -spin rate, w = 2 pi frequency",
    source="Hughes (1974), Dynamics of flexible space vehicles with active attitude control",
    parameters=(
        *(Parameter(f"inertia_{a}", "kg*m^2", f"effective inertia of the mode about {a}", low=0.0) for a in "xyz"),
        FREQUENCY,
        DAMPING,
    ),
    law=_law,
    states=STATES,
    rate=lambda s, p: rates(s, p, s["spin_rate"]),
    experiment="stop the arm of {at} at once and record how the base rings with the joints locked",
)
