"""Makkar friction: Stribeck, Coulomb and viscous friction in one smooth curve.

The paper's gamma_1 ... gamma_6 are ``stribeck_level``, 1 / ``stribeck_speed``, 1 / (``stribeck_ratio`` *
``stribeck_speed``), ``coulomb_level``, 1 / ``coulomb_speed``, ``viscous_coefficient``. Speeds stand for the paper's
slopes [s/S] because they scale with the joint; the ratio, above 1, makes the law dissipate for every value inside
the bounds. A ``coulomb_speed`` near the joint's own speed bends the curve: concave friction that saturates slowly.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    stribeck = s["qd"] / p["stribeck_speed"]
    return (
        p["stribeck_level"] * (ca.tanh(stribeck) - ca.tanh(stribeck / p["stribeck_ratio"]))
        + p["coulomb_level"] * ca.tanh(s["qd"] / p["coulomb_speed"])
        + p["viscous_coefficient"] * s["qd"]
    )


EFFECT = Effect(
    name="makkar_friction",
    family="joint friction",
    at="joint",
    sentence="friction that rises steeply from rest, dips, saturates and then grows with speed",
    equation="stribeck_level * (tanh(qd/stribeck_speed) - tanh(qd/(stribeck_ratio*stribeck_speed)))"
    " + coulomb_level * tanh(qd/coulomb_speed) + viscous_coefficient * qd",
    source="Makkar, Dixon, Sawyer and Hu (2005); Tian, Tang, Dai and Li (eq. 11)",
    parameters=(
        Parameter("stribeck_level", "T", "height of the bump near rest", low=0.0),
        Parameter(
            "stribeck_speed",
            "S/s",
            "speed over which the bump rises",
            zero=0.01,
            low=1e-3,
            high=0.5,
            grid=(0.01, 0.03, 0.1),
            relative_to="speed",
        ),
        Parameter(
            "stribeck_ratio",
            "1",
            "speed over which the bump fades, as a multiple of that over which it rises",
            zero=5.0,
            low=1.05,
            high=200.0,
            grid=(1.1, 2.0, 10.0),
        ),
        Parameter("coulomb_level", "T", "level at which friction saturates", low=0.0),
        Parameter(
            "coulomb_speed",
            "S/s",
            "speed over which friction saturates; large for a concave curve",
            zero=0.01,
            low=1e-3,
            high=10.0,
            grid=(0.01, 0.1, 0.3, 1.0),
            relative_to="speed",
        ),
        Parameter("viscous_coefficient", "T*s/S", "friction per speed", low=0.0),
    ),
    law=_law,
    dissipates=True,
    at_rest=True,
    contains=("viscous_friction", "coulomb_friction", "stribeck_friction"),
    experiment="run {at} to and fro at ten or more steady speeds, from a crawl to its peak speed",
)
