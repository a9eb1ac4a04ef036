"""A constant delay with a finite state, for the effects that are one.

A pure delay has no finite state. Padé's [3/4] has four, and a phase within 1 % of the delay's up to (angular frequency
* delay) = 4.5. Unlike [n/n] it passes nothing at once: a step, as friction makes one where a joint turns, comes late.
With x = delay * d/dt and the states x^k w, where D(x) w = value, it gives N(x) w.
"""

import casadi as ca

from ..effect import Parameter, Symbols

_NEVER_ZERO = 1e-8  # [s] added to the delay: the states have a rate at zero delay, and the fit a derivative there
_NUMERATOR = (1, -3 / 7, 1 / 14, -1 / 210)
_DENOMINATOR = (1, 4 / 7, 1 / 7, 2 / 105, 1 / 840)

STATES = ("lagged", "lagged_1", "lagged_2", "lagged_3")
EQUATION = "(1 - 3x/7 + x^2/14 - x^3/210) / (1 + 4x/7 + x^2/7 + 2x^3/105 + x^4/840) with x = delay * d/dt"


def delay(meaning: str) -> Parameter:
    """The time of the delay [s], and what it is in words."""
    usual = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
    return Parameter("delay", "s", meaning, low=0.0, high=0.2, grid=usual)


def rate(s: Symbols, p: Symbols) -> list[ca.SX]:
    """Rates of the four states [1/s times the channel's unit]."""
    states = [s[name] for name in STATES]
    highest = (s["value"] - sum(d * x for d, x in zip(_DENOMINATOR, states, strict=False))) / _DENOMINATOR[-1]
    return [x / (p["delay"] + _NEVER_ZERO) for x in (*states[1:], highest)]


def law(s: Symbols, p: Symbols) -> ca.SX:
    """``value(time - delay)``."""
    return ca.dot(ca.DM(_NUMERATOR), ca.vertcat(*(s[name] for name in STATES)))
