"""Viscous friction: torque proportional to speed."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["coefficient"] * s["qd"]


EFFECT = Effect(
    name="viscous_friction",
    family="joint friction",
    at="joint",
    sentence="friction that grows in proportion to speed",
    equation="coefficient * qd",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit (1994)",
    parameters=(Parameter("coefficient", "T*s/S", "friction per speed", low=0.0),),
    law=_law,
    dissipates=True,
    neighbours="too",
    experiment="run {at} at three or more steady speeds, all at one temperature, and compare the torques",
)
