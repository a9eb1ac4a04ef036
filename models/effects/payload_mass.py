"""Payload mass: a point mass that the model does not know of, carried at the link's far end.

Where it sits is fitted too, as an offset from the far end. The far end ``s["tip"]`` (3 numbers [m], in the link's
frame) is the origin of the next joint; for the last link, which has none, it is the link's centre of mass.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    x, y, z = ca.vertsplit(s["tip"] + ca.vertcat(p["x"], p["y"], p["z"]))
    unit_mass = ca.vertcat(1, x, y, z, y**2 + z**2, -x * y, -x * z, x**2 + z**2, -y * z, x**2 + y**2)
    return s["phi"] + p["mass"] * unit_mass


EFFECT = Effect(
    name="payload_mass",
    family="structure and mass",
    at="link",
    sentence="the link carries more mass at its far end than the model says",
    equation="phi + mass * (1, r, |r|^2 * identity - r r') at r = tip + (x, y, z)",
    source="Atkeson, An and Hollerbach (1986)",
    parameters=(
        Parameter("mass", "kg", "mass at the link's far end", low=0.0),
        Parameter(
            "x", "m", "its place from the far end, along the link frame's x axis", low=-1.0, high=1.0, grid=(0.0,)
        ),
        Parameter(
            "y", "m", "its place from the far end, along the link frame's y axis", low=-1.0, high=1.0, grid=(0.0,)
        ),
        Parameter(
            "z", "m", "its place from the far end, along the link frame's z axis", low=-1.0, high=1.0, grid=(0.0,)
        ),
    ),
    law=_law,
    experiment="hold {at} still in several postures under gravity, or weigh what its link carries",
)
