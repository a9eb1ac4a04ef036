"""Coulomb friction: a constant level against the motion."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["level"] * direction(s)


EFFECT = Effect(
    name="coulomb_friction",
    family="joint friction",
    at="joint",
    sentence="friction that does not depend on speed and changes sign with it",
    equation="level * sgn(qd), the sign smoothed over 0.1 % of the joint's peak speed",
    source="Coulomb (1785); Armstrong-Hélouvry, Dupont and Canudas de Wit (1994)",
    parameters=(Parameter("level", "T", "friction while moving", low=0.0),),
    law=_law,
    dissipates=True,
    neighbours="too",
    experiment="run {at} to and fro at one low steady speed and halve the difference of the two torques",
)
