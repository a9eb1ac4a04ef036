"""Backlash: play in the gear, so that the link floats free of the motor while the load turns round.

A spring with a dead band between motor and link (Nordin and Gutman 2002): as joint elasticity, with no torque inside
half the gap either side. Corners are rounded over a twentieth of it, which leaves the dead band a thousandth of the
spring's stiffness, and an arm at rest in it a steady state.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_ROUND = 0.05
_NEVER_ZERO = 1e-30  # [S] the roots have a slope without a gap too


def _twist_acceleration(s: Symbols, p: Symbols) -> ca.SX:
    half = p["gap"] / 2 + _NEVER_ZERO
    rounding = (_ROUND * half) ** 2
    past = (ca.sqrt((s["twist"] - half) ** 2 + rounding) - ca.sqrt((s["twist"] + half) ** 2 + rounding)) / 2
    spring = p["stiffness"] * (s["twist"] + past)
    return (s["load"] - p["damping"] * s["twist_rate"] - spring) / s["inertia"]


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [s["twist_rate"], _twist_acceleration(s, p)]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return -ca.vertcat(s["twist"], s["twist_rate"], _twist_acceleration(s, p))


EFFECT = Effect(
    name="backlash",
    family="drive train",
    at="joint",
    sentence="play in the gear: the link floats free and knocks when the load turns round",
    equation="inertia * twist'' + damping * twist' + stiffness * (twist beyond gap/2 either side) = load; "
    "link position = motor position - twist",
    source="Nordin and Gutman (2002)",
    parameters=(
        Parameter(
            "stiffness",
            "T/S",
            "torque per twist beyond the gap",
            zero=300.0,
            low=2.0,
            high=1e5,
            grid=(100.0, 1000.0),
            relative_to="rate",
        ),
        Parameter(
            "damping",
            "T*s/S",
            "torque per twist rate",
            zero=0.1,
            low=0.0,
            high=1e4,
            grid=(3.0,),
            relative_to="rate",
        ),
        Parameter(
            "gap",
            "S",
            "travel of the motor across the play",
            zero=0.0,
            low=0.0,
            high=0.2,
            grid=(3e-4, 1e-3, 3e-3, 0.01, 0.03),
            relative_to="travel",
        ),
    ),
    law=_law,
    states=("twist", "twist_rate"),
    rate=_rate,
    acts_on="position",
    contains=("joint_elasticity",),
    experiment="hold the link of {at}, turn its motor to and fro, and draw the torque over the motor's position",
)
