"""Sensor gain: a channel's scale is not what its calibration says."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return (1 + p["error"]) * s["value"]


EFFECT = Effect(
    name="sensor_gain",
    family="measurement",
    at="sensor",
    sentence="the sensor's scale is off by a constant factor",
    equation="(1 + error) * value",
    source="JCGM 200:2012, 4.12 (sensitivity of a measuring system)",
    # A channel that reads less than a tenth is dead or in another unit; one that reads nothing tells no parameter.
    parameters=(Parameter("error", "1", "relative error of the scale", low=-0.9),),
    law=_law,
    experiment="load {at} at rest with two known weights, or check its channel against a calibrated sensor",
)
