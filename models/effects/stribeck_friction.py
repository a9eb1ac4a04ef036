"""Stribeck friction: the extra friction near rest that fades as the lubricant film builds up."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["level"] * ca.exp(-((s["qd"] / p["speed"]) ** 2)) * direction(s)


EFFECT = Effect(
    name="stribeck_friction",
    family="joint friction",
    at="joint",
    sentence="extra friction at a crawl that fades as speed rises",
    equation="level * exp(-(qd / speed)^2) * sgn(qd), on top of Coulomb friction",
    source="Stribeck (1902); exponent 2: Armstrong-Hélouvry, Dupont and Canudas de Wit (1994)",
    parameters=(
        Parameter("level", "T", "static friction above the Coulomb level", low=0.0),
        Parameter(
            "speed",
            "S/s",
            "speed over which the extra friction fades",
            zero=0.1,
            low=0.005,
            high=1.0,
            grid=(0.01, 0.03, 0.1, 0.3),
            relative_to="speed",
        ),
    ),
    law=_law,
    dissipates=True,
    contains=("coulomb_friction",),
    exceeds_at_rest=True,
    experiment="run {at} to and fro at five or more steady speeds below a tenth of its peak speed",
)
