"""Sensor delay: a channel reports what was true a moment ago.

A pure delay has no finite state. Padé's all-pass [2/2] has two, gain 1 at every frequency, and a phase within 1 % of
the delay's up to (angular frequency * delay) = 1.7. With the states ``lagged`` = w and ``slope`` = delay * w', where
delay^2/12 * w'' + delay/2 * w' + w = value, it reads value - slope.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_NEVER_ZERO = 1e-8  # [s] added to the delay: the states have a rate at zero delay, and the fit a derivative there


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    delay = p["delay"] + _NEVER_ZERO
    return [s["slope"] / delay, 12 * (s["value"] - s["lagged"] - s["slope"] / 2) / delay]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return s["value"] - s["slope"]


EFFECT = Effect(
    name="sensor_delay",
    family="measurement",
    at="sensor",
    sentence="the channel lags the others by a constant time",
    equation="value(time - delay), as (1 - x/2 + x^2/12) / (1 + x/2 + x^2/12) with x = delay * d/dt",
    source="Padé (1892)",
    parameters=(
        Parameter(
            "delay",
            "s",
            "time by which the channel lags",
            low=0.0,
            high=0.2,
            grid=(2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2),
        ),
    ),
    law=_law,
    states=("lagged", "slope"),
    rate=_rate,
    experiment="excite {at} with pulses or a sweep up to the highest frequency that its drive can follow",
)
