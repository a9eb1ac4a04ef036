"""Presliding hysteresis: friction that builds up over a short travel after a reversal, instead of at once.

Asperities bend like bristles before they slip. The bent share z of the level follows Dahl's model; the law is what that
differs from a friction that jumps, so that beside Coulomb friction of the same level it is Dahl's friction. It shows in
the torque of a joint that seems to stand still.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [(s["qd"] - ca.fabs(s["qd"]) * s["bent"]) / p["travel"] - 1e-6 * s["bent"]]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["level"] * (s["bent"] - direction(s))


EFFECT = Effect(
    name="presliding_hysteresis",
    family="joint friction",
    at="joint",
    sentence="friction that builds up over a short travel after each reversal instead of at once",
    equation="level * (bent - sgn(qd)), travel * bent' = qd - |qd| * bent; on top of Coulomb friction",
    source="Dahl (1968); Canudas de Wit, Olsson, Åström and Lischinsky (1995)",
    parameters=(
        Parameter("level", "T", "friction that builds up late", low=0.0),
        Parameter(
            "travel",
            "S",
            "travel over which it builds up",
            zero=1e-3,
            low=1e-6,
            high=0.1,
            grid=(1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03),
            relative_to="travel",
        ),
    ),
    law=_law,
    states=("bent",),
    rate=_rate,
    at_rest=True,
    remembers=True,
    experiment="move {at} to and fro by ever smaller strokes around rest and draw its torque over its position",
)
