"""Propellant slosh: a part of the liquid swings in its tank against the base, at low frequency.

Spring-mass analogue of the lowest mode, alike in all directions: without gravity a surface-tension device holds the
liquid. The base's own inertia, in the model, holds the sloshing mass as if it were rigid; terms of the base's spin
squared are left out.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._oscillators import DAMPING, FREQUENCY, STATES, rates, second_rates


def _place(p: Symbols) -> ca.SX:
    return ca.vertcat(p["x"], p["y"], p["z"])


def _driven(s: Symbols, p: Symbols) -> ca.SX:
    return s["acceleration"] + ca.cross(s["spin_rate"], _place(p))


def _law(s: Symbols, p: Symbols) -> ca.SX:
    force = -p["mass"] * second_rates(s, p, _driven(s, p))
    return ca.vertcat(force, ca.cross(_place(p), force))


EFFECT = Effect(
    name="propellant_slosh",
    family="free-floating base",
    at="base",
    sentence="liquid sloshes in a tank and pushes the base to and fro",
    equation="force -mass * e'' at (x, y, z), e'' + 2 damping w e' + w² e = -acceleration there, w = 2 pi frequency",
    source="Abramson (1966), The dynamic behavior of liquids in moving containers, NASA SP-106 (spring-mass analogue)",
    parameters=(
        Parameter("mass", "kg", "mass that sloshes", low=0.0),
        *(
            Parameter(a, "m", f"the tank's place along the base's {a} axis", low=-10.0, high=10.0, grid=(0.0,))
            for a in "xyz"
        ),
        FREQUENCY,
        DAMPING,
    ),
    law=_law,
    states=STATES,
    rate=lambda s, p: rates(s, p, _driven(s, p)),
    experiment="stop the arm of {at} at once and record how base velocity and spin ring with the joints locked",
)
