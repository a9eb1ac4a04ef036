"""Motor saturation: above a knee the logged torque, current times a constant, is more than the motor gives.

The iron saturates, so that each further ampere gives less; or the supply's voltage runs out. Back-EMF takes its share
of that voltage, so that the knee falls with speed along the motor's line from stall to its no-load speed, and rises
while the motor brakes. A knee that does not know speed has a no-load speed far above the joint's.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_ROUND = 0.05


def _law(s: Symbols, p: Symbols) -> ca.SX:
    knee = p["knee"]
    asked = s["value"] + knee * s["qd"] / p["no_load_speed"]
    rounding = (_ROUND * knee) ** 2 + 1e-30
    # What is asked beyond the knee, either side, its corner rounded.
    past = (ca.sqrt((asked - knee) ** 2 + rounding) - ca.sqrt((asked + knee) ** 2 + rounding)) / 2
    return s["value"] + p["excess"] * (asked + past)


EFFECT = Effect(
    name="motor_saturation",
    family="drive train",
    at="sensor",
    sentence="a motor that gives less torque than its current implies, once the torque is large",
    equation="value + excess * (x beyond knee either side), x = value + knee * qd / no_load_speed; the corner rounded "
    "over 5 % of the knee",
    source="Fitzgerald, Kingsley and Umans (2003), chapters 1 and 7",
    parameters=(
        Parameter("excess", "1", "reading per torque beyond the knee, above the torque itself", low=0.0),
        Parameter(
            "knee",
            "U",
            "torque at standstill from which on the motor saturates",
            zero=0.5,
            low=0.05,
            high=1.5,
            grid=(0.25, 0.35, 0.5, 0.65, 0.8),
            relative_to="torque",
        ),
        Parameter(
            "no_load_speed",
            "S/s",
            "speed at which back-EMF leaves no torque",
            zero=100.0,
            low=0.8,
            high=1e4,
            grid=(1.5, 3.0, 100.0),
            relative_to="speed",
        ),
    ),
    law=_law,
    experiment="let {at} lift ever larger known loads at one low speed, and draw its reading over the load; then again "
    "at a higher speed",
)
