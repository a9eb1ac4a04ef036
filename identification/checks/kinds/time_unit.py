"""Time in another unit than the one in which it is read: milliseconds taken for seconds, and the reverse."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading

_UNITS = (
    (1e-3, "ms", "milliseconds"),
    (1e-6, "us", "microseconds"),
    (1e-9, "ns", "nanoseconds"),
    (60.0, "min", "minutes"),
)

_USUAL, _DECADES = 5e-3, 1.0
"""Period [s] at which robots are sampled, and its spread in decades: prior of a reading's own period."""


def readings(case: CheckCase) -> list[Reading]:
    """All time stamps times each factor; and what was in seconds, divided where [signals] has a unit."""
    period = float(np.median([e.motion.period for e in case.experiments]))
    given = case.model.signals.get("time")
    found = []
    factors = list(_UNITS)
    if given is not None and (given.unit is not None or given.gain is not None):
        factors += [(1e3, "s", "seconds"), (1e6, "s", "seconds")]
    for factor, unit, words in factors:
        rarer = _usual(period * factor) - _usual(period)
        if factor < 1e-3 and period * factor < 1e-5:
            continue
        made = case.reading(
            "time_unit",
            ["time"],
            f"time is in {words} (a period of {period:.3g} s is one of {period * factor:.3g} s)",
            [case.mends.scaled("time", factor, unit)],
        )
        found.append(made.but(time=factor, rarer=rarer))
    return found


def _usual(period: float) -> float:
    """Log prior of a sample period, but for a constant."""
    return -0.5 * float(np.log10(period / _USUAL) / _DECADES) ** 2


KIND = Kind("time_unit", "time is in another unit than it is read in", readings)
