"""Joint elasticity: a spring and damper between the motor and the link it drives.

The twist is how far the motor is ahead of the link. The link's own inertia and the spring make a second-order system
driven by the rigid-body torque, and the link lags the measured motor position by the twist. The effect vanishes as the
stiffness goes to infinity, so the stiffness is a shape, and the effect has no amplitude.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _twist_acceleration(s: Symbols, p: Symbols) -> ca.SX:
    return (s["load"] - p["damping"] * s["twist_rate"] - p["stiffness"] * s["twist"]) / s["inertia"]


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [s["twist_rate"], _twist_acceleration(s, p)]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return -ca.vertcat(s["twist"], s["twist_rate"], _twist_acceleration(s, p))


EFFECT = Effect(
    name="joint_elasticity",
    family="drive train",
    at="joint",
    sentence="an elastic drive: the link lags the motor under load and rings after it",
    equation="inertia * twist'' + damping * twist' + stiffness * twist = load; link position = motor position - twist",
    source="Spong (1987)",
    parameters=(
        Parameter(
            "stiffness",
            "T/S",
            "torque per twist",
            zero=300.0,
            low=2.0,
            high=1e5,
            grid=(10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0),
            relative_to="rate",
        ),
        # Multiples of peak torque per travel, times one second.
        Parameter(
            "damping",
            "T*s/S",
            "torque per twist rate",
            zero=0.1,
            low=0.0,
            high=1e4,
            grid=(0.01, 0.1, 1.0),
            relative_to="rate",
        ),
    ),
    law=_law,
    states=("twist", "twist_rate"),
    rate=_rate,
    acts_on="position",
    experiment="lock the link of {at} and load it step by step while its motor position is recorded, or sweep {at} "
    "in frequency through its ringing",
)
