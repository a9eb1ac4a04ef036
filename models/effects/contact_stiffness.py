"""Contact stiffness: how far cable and pin sink into each other under load, Hertz's law.

A model without it has the set-up's steel on steel, which sinks in by a few micrometres: as good as rigid.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["stiffness"] * ca.sqrt(s["overlap"] ** 2 + 1e-24) ** 1.5


EFFECT = Effect(
    name="contact_stiffness",
    family="snare and contact",
    at="pin",
    sentence="cables and pin give way under load more than steel on steel does",
    equation="stiffness * overlap^1.5",
    source="Hertz (1882); Li et al. (soft capture), eq. 19",
    parameters=(
        Parameter(
            "stiffness",
            "N/m^1.5",
            "force per overlap to the power of 1.5",
            low=0.0,
            grid=(1e7, 2e6, 3e5),
        ),
    ),
    law=_law,
    experiment="press one cable on {at} with known loads, and measure how far it sinks in",
)
