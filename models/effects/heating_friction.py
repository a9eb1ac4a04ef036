"""Heating friction: grease thins as the joint warms, and its friction falls with the heat that it has taken up.

The heat is that of a friction that does not depend on speed, so that it comes in with the distance travelled, and
leaves by Newton's cooling; ``warmth`` is its share of what peak speed would hold up for ever. Where the joint's
temperature was recorded (``temp.<joint>``), ``per_kelvin`` is the fall by what it reads above 20 °C. What friction is
when cold is other effects'.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction

_COLD, _HOTTEST = 20.0, 1e4  # [°C]; a temperature that was not recorded is no number, and below nothing


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    return [(ca.fabs(s["qd"]) / s["speed_scale"] - s["warmth"]) / p["time"]]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    warmer = ca.if_else(s["temperature"] < _HOTTEST, s["temperature"] - _COLD, 0)
    return -(p["fall"] * s["warmth"] + p["per_kelvin"] * warmer) * direction(s)


EFFECT = Effect(
    name="heating_friction",
    family="joint friction",
    at="joint",
    sentence="friction that falls as the joint warms",
    equation="-(fall * warmth + per_kelvin * (temperature - 20)) * sgn(qd), "
    "time * warmth' = |qd| / peak speed - warmth",
    source="Bittencourt, Wernholt, Sander-Tavallaey and Brogårdh (2010); Newton (1701)",
    parameters=(
        Parameter("fall", "T", "friction lost once warm from running at peak speed", low=0.0),
        Parameter("per_kelvin", "T/kelvin", "friction lost per kelvin of the recorded temperature", low=0.0),
        Parameter(
            "time",
            "s",
            "time that the joint takes to warm or to cool",
            zero=30.0,
            low=0.5,
            high=1e4,
            grid=(3.0, 6.0, 12.0, 30.0, 100.0, 1000.0),
        ),
    ),
    law=_law,
    states=("warmth",),
    rate=_rate,
    from_zero=True,
    experiment="let {at} rest until it is cold, then repeat one motion without a pause and compare its first minute "
    "with its last",
)
