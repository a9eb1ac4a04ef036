"""Suspension sway: the carriage follows late, so the sling leaves the vertical and pulls the arm back.

The hang point's horizontal lead on the carriage, of first order in its velocity, times the sling's pendulum stiffness
is a horizontal force. At a steady speed that force grows with it: it poses as viscous friction.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [s["velocity"][i] - s[name] / p["lag"] for i, name in enumerate(("lead_x", "lead_y"))]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return ca.vertcat(-p["stiffness"] * s["lead_x"], -p["stiffness"] * s["lead_y"], 0, 0, 0, 0)


EFFECT = Effect(
    name="suspension_sway",
    family="suspension rig",
    at="sling",
    sentence="the carriage follows late, so that the sling leaves the vertical and drags the arm sideways",
    equation="horizontal force -stiffness * lead, lead' = velocity - lead / lag",
    source="Sato, Ejiri, Iida et al. (1991)",
    parameters=(
        Parameter("stiffness", "N/m", "horizontal force per lead: tension over length of the sling", low=0.0),
        Parameter(
            "lag", "s", "time by which the carriage lags", zero=0.5, low=0.01, high=30.0, grid=(0.1, 0.4, 1.5, 5.0)
        ),
    ),
    law=_law,
    states=("lead_x", "lead_y"),
    rate=_rate,
    experiment="repeat the motion at half speed, or measure the angle of {at} with the vertical",
)
