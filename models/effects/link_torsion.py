"""Link torsion: a boom is twisted about its length, against a suspension that keeps its height.

The joint behind the boom holds one roll angle and the slings beyond the boom another. With slings of constant tension
nothing comes of it; with a suspension of stiffness k, a boom of torsional stiffness K and a misfit angle, boom and
slings are springs in series: slings at levers b (sideways from the boom's line) change their pull by
``-torque * b / (radius^2 + sum b^2)`` with ``torque`` = K * misfit and ``radius``^2 = K / k. Stretched out, the levers
are zero and nothing shows; it builds up as the arm folds sideways, and stays at rest.

On an arm without slings the link is a torsion spring that all beyond its far end turns on.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._elastic_link import elastic_link


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return ca.vertcat(-p["torque"] / (p["radius"] ** 2 + s["spread"][0]), 0)


EFFECT = Effect(
    name="link_torsion",
    family="structure and mass",
    at="boom",
    sentence="the link is twisted about its length, and slings that hold their height therefore load the arm",
    equation="each sling beyond: upward force -torque * lever / (radius^2 + sum of lever^2), lever sideways from it",
    source="Tian, Tang, Dai and Li, section 3; springs in series: Hooke (1678)",
    parameters=(
        Parameter("torque", "N*m", "torque in the link if the suspension were rigid: torsional stiffness times misfit"),
        Parameter(
            "radius",
            "m",
            "root of the link's torsional stiffness over the suspension's stiffness",
            zero=3.0,
            low=0.05,
            high=100.0,
            grid=(0.3, 1.0, 3.0, 10.0),
        ),
    ),
    law=_law,
    elsewhere=elastic_link(
        "link_torsion",
        (0,),
        "the link twists about its length under load, and all beyond it lags",
        "inertia * twist'' + damping * twist' + stiffness * twist = torque in the link at its far end",
        "Book (1984), small deflections",
        "load the far end of {at} with a torque about its length and measure the twist, or excite its ringing",
    ),
    experiment="track the twist of {at} with targets at both its ends, or repeat the motion with softer slings",
)
