"""External torque: something outside turns the base, and with it the angular momentum of the whole system."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(_s: Symbols, p: Symbols) -> ca.SX:
    return ca.vertcat(0, 0, 0, p["x"], p["y"], p["z"])


EFFECT = Effect(
    name="external_torque",
    family="free-floating base",
    at="base",
    sentence="a steady torque from outside turns the base",
    equation="moment (x, y, z) on the base, steady in its axes",
    source="Wertz (1978), ch. 17 (disturbance torques)",
    parameters=tuple(Parameter(axis, "N*m", f"moment about the base's {axis} axis") for axis in "xyz"),
    law=_law,
    experiment="let {at} drift with the joints locked: only a torque from outside then changes its spin",
)
