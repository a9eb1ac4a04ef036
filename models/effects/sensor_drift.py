"""Sensor drift: a channel's zero wanders in proportion to time from the recording's start."""

import casadi as ca

from ..effect import Effect, Parameter, Symbols


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return s["value"] + p["rate"] * s["time"]


EFFECT = Effect(
    name="sensor_drift",
    family="measurement",
    at="sensor",
    sentence="the sensor's zero moves at a constant rate",
    equation="value + rate * time, time from the recording's start",
    source="JCGM 200:2012, 4.21 (instrumental drift)",
    parameters=(Parameter("rate", "U/s", "change of the zero per second"),),
    law=_law,
    experiment="return {at} to the same posture at the start, the middle and the end of one recording",
)
