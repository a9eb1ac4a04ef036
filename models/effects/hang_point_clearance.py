"""Hang-point clearance: play at the hang point, so that the sling pulls from the trailing edge of its hole.

The offset of the sling's line from the middle of the hole turns with the direction of the horizontal motion and stays
when the motion stops; its moment with the weight carried is felt by joints with horizontal axes. Along a straight line
the offset closes in on the trailing edge exponentially in the distance gone.

On a snare's hanging target the play is at the top of its line, without friction: the line hangs upright, and pulls
nowhere sideways, until it meets the rim (``models/snare/line.py``; Nordin and Gutman 2002).
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_LEAK = 1e-4  # [1/s] gives a hang point at rest a steady state
_CREEP = 1e-3  # [m/s] slower than this counts as a servo at rest, whose tremor must not choose an edge to start from
_NEVER_ZERO = 1e-9  # [m] added to the clearance: the states have a rate without any


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    x, y = s["velocity"][0], s["velocity"][1]
    square = x**2 + y**2
    awake = square / (square + _CREEP**2)
    speed = ca.sqrt(square + 1e-18)
    return [
        awake * (v - speed * s[name]) / (p["clearance"] + _NEVER_ZERO) - _LEAK * s[name]
        for v, name in ((x, "trail_x"), (y, "trail_y"))
    ]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    moment = p["clearance"] * s["weight"]
    return ca.vertcat(0, 0, 0, -moment * s["trail_y"], moment * s["trail_x"], 0)


EFFECT = Effect(
    name="hang_point_clearance",
    family="suspension rig",
    at="sling",
    sentence="play at the hang point: the sling pulls from one edge of its hole, and from the other when the motion "
    "turns",
    equation="moment -clearance * trail x weight (upward), clearance * trail' = velocity - |velocity| * trail, "
    "horizontal",
    source="Dahl (1968), for the play's path",
    parameters=(
        Parameter(
            "clearance",
            "m",
            "radius of the play",
            low=0.0,
            high=0.1,
            grid=(1e-3, 3e-3, 1e-2, 3e-2),
        ),
    ),
    law=_law,
    states=("trail_x", "trail_y"),
    rate=_rate,
    experiment="push the hang point of {at} to either side by hand with the arm at rest, and read the joints with "
    "horizontal axes",
)
