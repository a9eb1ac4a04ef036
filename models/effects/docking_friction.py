"""Docking friction: the balls rub on the flanks of their grooves; bristles hold what rests."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["coefficient"] * s["normal_force"] * s["presliding"]


EFFECT = Effect(
    name="docking_friction",
    family="docking",
    at="grooves",
    sentence="the balls rub on the flanks of their grooves",
    equation="coefficient * normal force * presliding, its size one where it slides",
    source="Dupont, Hayward, Armstrong and Altpeter (2002), single-state elastoplastic friction",
    parameters=(Parameter("coefficient", "1", "friction force per normal force", low=0.0, high=1.0, grid=(0.08, 0.2)),),
    law=_law,
    experiment="seat the balls in the {at} from either side under a small pull, and compare where they come to rest",
)
