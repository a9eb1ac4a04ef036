"""Presliding hysteresis: friction that builds up over a short travel after a reversal, instead of at once.

Asperities bend like bristles before they slip. What they carry follows Dahl's model; the law is what that differs from
a friction that jumps, so that beside Coulomb friction of the same level, and load-dependent friction that is the same
share of it per load, it is Dahl's friction. It shows in the torque of a joint that seems to stand still.

More load lets the bristles carry more, and makes them no stiffer: they slip after so much more travel. ``bent`` is what
they carry as a share of the level without load.

Over travel in one direction Dahl's equation has a closed solution, so that the bent share stays between its ends
however short the travel is: between two samples the joint may turn once, where its speed, linear in time, crosses zero.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _most(s: Symbols, p: Symbols) -> ca.SX:
    """What the bristles carry when they slip, as a share of the level without load."""
    return 1 + p["by_load"] * ca.fabs(s["load"])


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [(s["qd"] - ca.fabs(s["qd"]) * s["bent"] / _most(s, p)) / p["travel"] - 1e-6 * s["bent"]]


def _advance(s: Symbols, later: Symbols, p: Symbols, h: ca.SX) -> list[ca.SX]:
    before, after = s["qd"], later["qd"]
    turns, both = before * after < 0, ca.fabs(before) + ca.fabs(after)
    bent, most = s["bent"], _most(s, p)
    for speed in (before, after):
        # Half the step each or, where it turns, as long as it takes to come to rest.
        end = most * ca.sign(ca.if_else(turns, speed, before + after))
        travelled = 0.5 * h * ca.if_else(turns, speed**2 / ca.fmax(both, 1e-300), 0.5 * both)
        bent = end + (bent - end) * ca.exp(-travelled / (most * p["travel"]))
    return [bent]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["level"] * (s["bent"] - _most(s, p) * direction(s))


EFFECT = Effect(
    name="presliding_hysteresis",
    family="joint friction",
    at="joint",
    sentence="friction that builds up over a short travel after each reversal instead of at once",
    equation="level * (bent - most * sgn(qd)), travel * bent' = qd - |qd| * bent / most, most = 1 + by_load * |load|; "
    "on top of Coulomb and load-dependent friction",
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
        Parameter(
            "by_load",
            "1/T",
            "growth of that level per load",
            low=0.0,
            high=300.0,
            grid=(1e-3,),
            relative_to="per_torque",
        ),
    ),
    law=_law,
    states=("bent",),
    rate=_rate,
    advance=_advance,
    at_rest=True,
    remembers=True,
    experiment="move {at} to and fro by ever smaller strokes around rest and draw its torque over its position",
)
