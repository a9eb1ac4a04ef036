"""Carriage friction: seals, guides and screw resist the carriage of an end effector, dry and viscous together."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["level"] * ca.tanh(s["qd"] / s["slip_velocity"]) + p["viscous"] * s["qd"]


EFFECT = Effect(
    name="carriage_friction",
    family="docking",
    at="carriage",
    sentence="seals and guides resist the carriage",
    equation="level * tanh(qd / slip velocity) + viscous * qd",
    source="Coulomb (1785); Armstrong-Helouvry, Dupont and Canudas de Wit (1994), section 2",
    parameters=(
        Parameter("level", "N", "dry friction", low=0.0, high=1e3, grid=(20.0, 80.0)),
        Parameter("viscous", "N*s/m", "friction per speed", low=0.0, high=2e4, grid=(200.0,)),
    ),
    law=_law,
    dissipates=True,
    experiment="run the {at} out and back at two speeds with nothing grasped, and compare the motor's force both ways",
)
