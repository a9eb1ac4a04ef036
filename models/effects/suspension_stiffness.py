"""Suspension stiffness: slings that should hold their tension hold their height as well.

A winch or a spring that gives way too little pulls less where its hang point rises, and more where it sinks. Heights
count from the pose with all joints at zero, in which the slings were balanced. Beside a twisted or bent boom this is
what makes the misfit felt, and it loads the arm without any misfit too.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["stiffness"]


EFFECT = Effect(
    name="suspension_stiffness",
    family="suspension rig",
    at="suspension",
    sentence="the slings hold the height of their hang points, where they should hold only their tension",
    equation="each sling: upward force -stiffness * rise of its hang point since all joints were at zero",
    source="Hooke (1678); Tian, Tang, Dai and Li, section 3",
    parameters=(Parameter("stiffness", "N/m", "tension that each sling loses per rise of its hang point", low=0.0),),
    law=_law,
    experiment="move the arm's joints so that it rises by a known height, and read load cells in the {at}",
)
