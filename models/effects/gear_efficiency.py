"""Gear efficiency: what a gear loses of the load it carries, one share when it drives and another when it brakes.

A gear of efficiency eta takes load / eta from a motor that drives, and hands load * eta to one that brakes: of the load
it loses 1 / eta - 1 one way, and 1 - eta the other, where a worm or a harmonic drive is less efficient still. The load
is the model's rigid-body torque, never the measured one. With both shares the same this is load-dependent friction.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols
from ._direction import direction


def _law(s: Symbols, p: Symbols) -> ca.SX:
    share = ca.if_else(s["load"] * s["qd"] > 0, p["driving_loss"], p["braking_loss"])
    return share * ca.fabs(s["load"]) * direction(s)


EFFECT = Effect(
    name="gear_efficiency",
    family="drive train",
    at="joint",
    sentence="a gear whose loss is another share of the load while it drives than while it brakes",
    equation="(driving_loss if load * qd > 0, else braking_loss) * |load| * sgn(qd); driving_loss = 1/efficiency - 1",
    source="Wang and Lee (2004); Giberti, Cinquemani and Legnani (2010)",
    parameters=(
        Parameter("driving_loss", "1", "share of the load lost while the motor drives it", low=0.0),
        Parameter("braking_loss", "1", "share of the load lost while the motor holds it back", low=0.0),
    ),
    law=_law,
    dissipates=True,
    contains=("load_dependent_friction",),
    experiment="raise and lower a known load with {at} at one steady speed, and compare what each way costs with the "
    "same motion without the load",
)
