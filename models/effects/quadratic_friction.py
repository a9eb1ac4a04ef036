"""Quadratic friction: drag that grows with the square of speed."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["coefficient"] * s["qd"] * ca.fabs(s["qd"])


EFFECT = Effect(
    name="quadratic_friction",
    family="joint friction",
    at="joint",
    sentence="drag that grows with the square of speed",
    equation="coefficient * qd * |qd|",
    source="Rayleigh (1876); Duclusaud et al. (2025)",
    parameters=(Parameter("coefficient", "T*s^2/S^2", "drag per square of speed", low=0.0),),
    law=_law,
    dissipates=True,
    experiment="run {at} to and fro at three or more steady speeds in the upper half of its range",
)
