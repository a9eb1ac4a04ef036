"""When samples were taken: as they are stamped, or evenly while the stamps jitter. The positions tell.

A controller samples by its own clock, and a logger stamps what it gets a little early or late. Splines at such stamps
add a noise of speed times jitter to the position, which the second derivative makes large; on an even clock there is
none. Where sampling itself jitters, it is the other way round.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Array = NDArray[np.float64]

ABOUT = 25
"""Samples to either side over which a clock's drift, and a joint's speed, are taken."""

LEAST = 1e-3
"""Jitter [periods] below which stamps are as good as any: rounding makes that much."""


def taken(stamps: Array, q: Array, period: float) -> tuple[Array, float]:
    """Times of samples [s] (n,), and the jitter that was taken out of their stamps [periods], zero where none was.

    Parameters
    ----------
    stamps : array (n,)
        Of a run without gaps [s].
    q : array (n, J)
        Positions.
    period : float
        [s]
    """
    if len(stamps) < 4 * ABOUT:
        return stamps, 0.0
    count = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(np.diff(stamps) / period), 1.0))])
    rate, start = np.polyfit(count, stamps, 1)
    line = start + rate * count
    even = line + savgol_filter(stamps - line, 2 * ABOUT + 1, 1)  # a mean inside, a straight line at the ends
    jitter = float(np.std(stamps - even) / period)
    moving = np.ptp(q, axis=0) > 0
    if jitter < LEAST or not moving.any():
        return stamps, 0.0
    stamped, evenly = (_rough(t, q[:, moving]) for t in (stamps, even))
    known = (stamped > 0) & (evenly > 0)
    return (even, jitter) if np.sum(np.log(stamped[known] / evenly[known])) > 0 else (stamps, 0.0)


def _rough(t: Array, q: Array) -> Array:
    """Mean square (J,) of the change, from step to step, of what positions (n, J) differ from their mean speed about
    them times how long a step took."""
    whole = slice(ABOUT, len(t) - 1 - ABOUT)
    speed = (q[2 * ABOUT + 1 :] - q[: -2 * ABOUT - 1]) / (t[2 * ABOUT + 1 :] - t[: -2 * ABOUT - 1])[:, None]
    missed = np.diff(q, axis=0)[whole] - speed * np.diff(t)[whole, None]
    return np.asarray(np.mean(np.diff(missed, axis=0) ** 2, axis=0), float)
