"""Umbilical stiffness: extra cables on the target, for power and data, draw it back to where it hung.

One of the two things that Li et al. name as left out of their own model of the ground test.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return -p["stiffness"] * s["displacement"]


EFFECT = Effect(
    name="umbilical_stiffness",
    family="snare and contact",
    at="target",
    sentence="an extra cable holds the target like a spring",
    equation="force -stiffness * displacement of the pin's foot since the start",
    source="Hooke (1678); Li et al. (soft capture), section 4, name the cable",
    parameters=(
        Parameter(
            "stiffness",
            "N/m",
            "force per displacement, in every direction",
            low=0.0,
            high=1e5,
            grid=(20.0, 100.0, 500.0),
        ),
    ),
    law=_law,
    experiment="push the {at} aside by hand, snare open, and let it swing: its frequencies rise with an umbilical",
)
