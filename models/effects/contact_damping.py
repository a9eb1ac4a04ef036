"""Contact damping: a contact loses energy as it is pressed in and let go, more where it is pressed harder.

The paper's C times the rate of the overlap pulls at first touch and at release. Hunt and Crossley's damping is in
proportion to the elastic force instead, so that a contact starts and ends without force, and never pulls.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["coefficient"] * s["elastic_force"] * s["approach"]


EFFECT = Effect(
    name="contact_damping",
    family="snare and contact",
    at="pin",
    sentence="cables and pin do not bounce off each other: a contact dissipates energy",
    equation="coefficient * elastic force * rate of the overlap, the whole force never below zero",
    source="Hunt and Crossley (1975)",
    parameters=(
        Parameter(
            "coefficient",
            "s/m",
            "share of the force per rate of the overlap",
            low=0.0,
            high=1e5,
            grid=(200.0, 2e3),
        ),
    ),
    law=_law,
    experiment="let one cable strike {at} at a known speed, and watch how high it bounces",
)
