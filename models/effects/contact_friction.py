"""Contact friction: the cables rub on the pin, Coulomb's law made smooth at zero slip."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    slip = s["slip"]
    size = ca.sqrt(ca.dot(slip, slip) + s["slip_velocity"] ** 2)
    return p["coefficient"] * s["normal_force"] * slip / size


EFFECT = Effect(
    name="contact_friction",
    family="snare and contact",
    at="pin",
    sentence="the cables rub on the pin and drag it along where they slide",
    equation="coefficient * normal force * slip / sqrt(|slip|^2 + slip velocity^2)",
    source="Coulomb (1785); Li et al. (soft capture), section 2",
    parameters=(
        Parameter("coefficient", "1", "friction force per normal force", low=0.0, high=1.5, grid=(0.08, 0.25)),
    ),
    law=_law,
    experiment="draw one cable slowly across {at} under a known load, and measure the force along it",
)
