"""Rotor inertia: the motor's own inertia, seen through the gear."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return p["inertia"] * s["qdd"]


EFFECT = Effect(
    name="rotor_inertia",
    family="drive train",
    at="joint",
    sentence="torque spent on accelerating the motor's own rotor",
    equation="inertia * qdd",
    source="Armstrong, Khatib and Burdick (1986)",
    parameters=(Parameter("inertia", "T*s^2/S", "rotor inertia times the gear ratio squared", low=0.0),),
    law=_law,
    neighbours="too",
    experiment="repeat one motion of {at} in two postures whose inertia at the joint differs",
)
