"""Sensor bias: a channel reads a constant too much."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return s["value"] + p["offset"]


EFFECT = Effect(
    name="sensor_bias",
    family="measurement",
    at="sensor",
    sentence="the sensor reads a constant too much or too little",
    equation="value + offset",
    source="JCGM 200:2012, 4.20 (instrumental bias)",
    parameters=(Parameter("offset", "U", "reading at a true value of zero"),),
    law=_law,
    experiment="record {at} unloaded and at rest, then with the load turned round",
)
