"""Link bending: a boom is bent in the vertical plane, against a suspension that keeps its height.

As link torsion, about the horizontal axis across the boom: levers are those along the boom, the stiffness is that of
its slope in bending. The misfit is between the slope that the joints hold and the one that the slings beyond do.

On an arm without slings the link is a bending spring, as stiff in every direction across its length.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._elastic_link import elastic_link
from .link_torsion import EFFECT as TORSION


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return ca.vertcat(0, -p["torque"] / (p["radius"] ** 2 + s["spread"][1]))


EFFECT = Effect(
    name="link_bending",
    family="structure and mass",
    at="boom",
    sentence="the link is bent up or down, and slings that hold their height therefore load the arm",
    equation="each sling beyond: upward force -torque * lever / (radius^2 + sum of lever^2), lever along it",
    source="springs in series: Hooke (1678)",
    parameters=(
        Parameter("torque", "N*m", "moment in the link if the suspension were rigid: bending stiffness times misfit"),
        Parameter(
            "radius",
            "m",
            "root of the link's bending stiffness (moment per slope) over the suspension's stiffness",
            zero=3.0,
            low=0.05,
            high=100.0,
            grid=TORSION.parameters[1].grid,
        ),
    ),
    law=_law,
    elsewhere=elastic_link(
        "link_bending",
        (1, 2),
        "the link bends under load, and all beyond it lags",
        "inertia * slope'' + damping * slope' + stiffness * slope = moment across the link at its far end",
        "Book (1984), small deflections",
        "load the far end of {at} with a moment across its length and measure the slope, or excite its ringing",
    ),
    experiment="measure the height of {at} at both its ends over the motion, or repeat it with softer slings",
)
