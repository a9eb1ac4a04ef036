"""Sling tension error: a sling pulls by more or less than what balances the arm.

A constant share stands for a counterweight or a servo's set point that is off; a loss in proportion to the speed at
which the hang point rises, for a winch that follows late. Vertical forces turn nothing about a vertical axis: such
joints are blind to it.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    upward = p["share"] * s["tension"] - p["lag_loss"] * s["velocity"][2]
    return ca.vertcat(0, 0, upward, 0, 0, 0)


EFFECT = Effect(
    name="sling_tension_error",
    family="suspension rig",
    at="sling",
    sentence="the sling pulls by more or less than what balances the arm",
    equation="upward force share * tension - lag_loss * (speed of rise), tension that of the balance",
    source="Sato, Ejiri, Iida et al. (1991); Tian, Tang, Dai and Li (eq. 12)",
    parameters=(
        Parameter("share", "1", "error of the tension, as a share of the tension in balance", low=-1.0),
        Parameter("lag_loss", "N*s/m", "tension lost per speed of rise, by a winch that follows late", low=0.0),
    ),
    law=_law,
    experiment="put a load cell into {at}, or hang a known weight on it and repeat the motion",
)
