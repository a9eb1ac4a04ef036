"""Cable pretension: a cable that is pulled before anything touches it; between two fixed ends it acts as a shorter one.

Held straight at its nominal length it would carry this tension. A cable with slack takes up the strain and bows less:
it meets the pin earlier.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(_s: Symbols, p: Symbols) -> ca.SX:
    return p["tension"]


EFFECT = Effect(
    name="cable_pretension",
    family="snare and contact",
    at="cables",
    sentence="the cables are tighter than in the model",
    equation="axial force tension + axial stiffness * strain",
    source="Hooke (1678), with a prestrain",
    parameters=(
        Parameter(
            "tension",
            "N",
            "tension of a cable held straight at its nominal length",
            low=0.0,
            high=5e3,
            grid=(200.0, 800.0),
        ),
    ),
    law=_law,
    experiment="measure the length of {at} between their fittings, unloaded, or the force that draws them straight",
)
