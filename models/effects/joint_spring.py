"""Joint spring: a spring between two joints, such as a hose that runs past both, or a tendon that couples them.

It acts along the sum or the difference of two joints of which one carries the other: a spring along the sum of the
angles pulls both joints alike. Written linear in its parameters: it is slack at -torque_at_zero / stiffness.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["stiffness"] * s["q"] + p["torque_at_zero"]


EFFECT = Effect(
    name="joint_spring",
    family="structure and mass",
    at="joint",
    sentence="a spring between two joints pulls on both",
    equation="stiffness * q + torque_at_zero, q the sum or the difference of two joints' positions; both feel it",
    source="Hooke (1678); Featherstone (2008), section 3.2, for forces along a combination of joints",
    parameters=(
        Parameter("stiffness", "T/S", "torque per travel", low=0.0),
        Parameter("torque_at_zero", "T", "torque at position zero", alone=False),
    ),
    law=_law,
    neighbours="only",
    experiment="hold one joint of {at} still at five positions across its travel while the other stands where gravity "
    "does not load it, and read the torque of the joint that stands",
)
