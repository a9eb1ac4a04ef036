"""Groove misalignment: a groove lies beside where its drawing has it, along the circle of the balls.

Offsets of all three together are a shift of the plate both ways and a turn about its axis.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(_s: Symbols, p: Symbols) -> ca.SX:
    return p["offset"]


EFFECT = Effect(
    name="groove_misalignment",
    family="docking",
    at="groove",
    sentence="a groove is offset from its place on the drawing",
    equation="the groove's middle plane shifted by offset, tangentially",
    source="Hale and Slocum (2001), errors of kinematic couplings",
    parameters=(
        Parameter(
            "offset", "m", "shift along the circle of the balls, positive with the turn from y to z",
            grid=(-2e-4, 2e-4),
        ),
    ),
    law=_law,
    experiment="measure {at} against the other two with a touch probe, or the pose seated without load",
)  # fmt: skip
