"""Sensor delay: a channel reports what was true a moment ago."""

from ..effect import Effect
from . import _delay

EFFECT = Effect(
    name="sensor_delay",
    family="measurement",
    at="sensor",
    sentence="the channel lags the others by a constant time",
    equation=f"value(time - delay), as {_delay.EQUATION}",
    source="Padé (1892)",
    parameters=(_delay.delay("time by which the channel lags"),),
    law=_delay.law,
    states=_delay.STATES,
    rate=_delay.rate,
    experiment="excite {at} with pulses or a sweep up to the highest frequency that its drive can follow, and compare "
    "its encoder and its torque with a second sensor of each",
)
