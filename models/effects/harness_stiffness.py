"""Harness stiffness: cables across the joint act as a spring.

Written linear in its parameters: the neutral position is -torque_at_zero / stiffness. ``torque_at_zero`` alone is an
exact alias of a bias of the joint's torque channel; only the stiffness marks a harness.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["stiffness"] * s["q"] + p["torque_at_zero"]


EFFECT = Effect(
    name="harness_stiffness",
    family="structure and mass",
    at="joint",
    sentence="cables across the joint pull it back like a spring",
    equation="stiffness * q + torque_at_zero",
    source="Hooke (1678)",
    parameters=(
        Parameter("stiffness", "T/S", "torque per travel", low=0.0),
        Parameter("torque_at_zero", "T", "torque at position zero", alone=False),
    ),
    law=_law,
    experiment="hold {at} still at five or more positions across its travel where gravity does not load it, "
    "approached from both sides",
)
