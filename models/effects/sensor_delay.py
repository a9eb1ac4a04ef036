"""Sensor delay: a channel reports what was true a moment ago.

A pure delay has no finite state. Padé's [3/4] has four, and a phase within 1 % of the delay's up to (angular frequency
* delay) = 4.5. Unlike [n/n] it passes nothing at once: a step, as friction makes one where a joint turns, comes late.
With x = delay * d/dt and the states x^k w, where D(x) w = value, it reads N(x) w.
"""

import casadi as ca

from ..effect import Effect, Parameter, Symbols

_NEVER_ZERO = 1e-8  # [s] added to the delay: the states have a rate at zero delay, and the fit a derivative there
_NUMERATOR = (1, -3 / 7, 1 / 14, -1 / 210)
_DENOMINATOR = (1, 4 / 7, 1 / 7, 2 / 105, 1 / 840)
_STATES = ("lagged", "lagged_1", "lagged_2", "lagged_3")


def _rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    states = [s[name] for name in _STATES]
    highest = (s["value"] - sum(d * x for d, x in zip(_DENOMINATOR, states, strict=False))) / _DENOMINATOR[-1]
    return [x / (p["delay"] + _NEVER_ZERO) for x in (*states[1:], highest)]


def _law(s: Symbols, p: Symbols) -> ca.SX:
    return ca.dot(ca.DM(_NUMERATOR), ca.vertcat(*(s[name] for name in _STATES)))


EFFECT = Effect(
    name="sensor_delay",
    family="measurement",
    at="sensor",
    sentence="the channel lags the others by a constant time",
    equation="value(time - delay), as (1 - 3x/7 + x^2/14 - x^3/210) / (1 + 4x/7 + x^2/7 + 2x^3/105 + x^4/840) with "
    "x = delay * d/dt",
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
    states=_STATES,
    rate=_rate,
    experiment="excite {at} with pulses or a sweep up to the highest frequency that its drive can follow",
)
