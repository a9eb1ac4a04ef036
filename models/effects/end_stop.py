"""End stop: from a place of the travel on, a bumper or a cable at its end pushes the joint back.

The stop is above ``where`` or below it, never both: that would be a spring. It lies inside the recorded travel, in its
outer fifths. Beyond one end it acts nowhere; beyond the other it acts everywhere, as a straight line, and is a spring.
A joint that meets a stop at both ends has the effect for the stronger. Rounded over the travel of 2 ms at peak speed.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _beyond(x: ca.SX, s: Symbols) -> ca.SX:
    return (x + ca.sqrt(x**2 + (2e-3 * s["speed_scale"]) ** 2)) / 2


def _law(s: Symbols, p: Symbols) -> ca.SX:
    x = s["q"] - p["where"]
    return p["above"] * _beyond(x, s) - p["below"] * _beyond(-x, s)


EFFECT = Effect(
    name="end_stop",
    family="structure and mass",
    at="joint",
    sentence="a stop near the end of the travel that pushes the joint back",
    equation="above * max(q - where, 0) - below * max(where - q, 0)",
    source="Hunt and Crossley (1975), without their damping",
    parameters=(
        Parameter("above", "T/S", "stiffness of a stop above that place", low=0.0),
        Parameter("below", "T/S", "stiffness of a stop below that place", low=0.0),
        Parameter(
            "where",
            "S",
            "position at which the joint meets the stop",
            zero=0.25,
            low=-0.5,
            high=0.5,
            grid=(-0.49, -0.46, -0.42, -0.36, -0.3, 0.3, 0.36, 0.42, 0.46, 0.49),
            relative_to="place",
        ),
    ),
    law=_law,
    exclusive=True,
    experiment="move {at} slowly towards each end of its travel and back, and draw its torque over its position",
)
