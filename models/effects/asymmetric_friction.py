"""Asymmetric friction: what friction in one direction exceeds friction in the other by.

Away from rest ``level_difference / 2`` is a constant: an exact alias of a bias of the torque channel. Only samples at
rest, or a second recording with the load turned round, tell them apart.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    moving = direction(s)
    return 0.5 * p["level_difference"] * moving**2 + 0.5 * p["coefficient_difference"] * s["qd"] * moving


EFFECT = Effect(
    name="asymmetric_friction",
    family="joint friction",
    at="joint",
    sentence="friction that is larger in one direction than in the other",
    equation="(level_difference * |sgn(qd)| + coefficient_difference * |qd|) / 2, on top of symmetric friction",
    source="Armstrong-Hélouvry, Dupont and Canudas de Wit (1994); Janot, Gautier and Brunot (2019)",
    parameters=(
        Parameter("level_difference", "T", "Coulomb level, positive minus negative direction"),
        Parameter("coefficient_difference", "T*s/S", "viscous coefficient, positive minus negative direction"),
    ),
    law=_law,
    experiment="run {at} to and fro at steady speeds, then again with the load turned round: a sensor's bias stays, "
    "friction follows the direction",
)
