"""Inertia error: a link's ten inertial parameters are not the model's.

Linear and without bounds: which sums are physical is a matter of all ten together, and the fit's to keep.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_PARAMETERS = (
    Parameter("mass", "kg", "change of the mass"),
    *(Parameter(f"moment_{axis}", "kg*m", f"change of mass times centre of mass, {axis}") for axis in "xyz"),
    *(
        Parameter(f"inertia_{axes}", "kg*m^2", f"change of the inertia about the link's frame, {axes}")
        for axes in ("xx", "xy", "xz", "yy", "yz", "zz")
    ),
)


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return s["phi"] + ca.vertcat(*(p[parameter.name] for parameter in _PARAMETERS))


EFFECT = Effect(
    name="inertia_error",
    family="structure and mass",
    at="link",
    sentence="the link's mass properties are not those of the model",
    equation="phi + (mass, moments, inertias)",
    source="Atkeson, An and Hollerbach (1986)",
    parameters=_PARAMETERS,
    law=_law,
    contains=("payload_mass", "com_offset"),
    experiment="move {at} fast in several postures, with and without a known mass on its link",
)
