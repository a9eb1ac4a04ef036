"""A ring that turns as it was recorded, in place of the ramp of `drive.ring_motion`.

Recorded angles are noisy, and cables hold their ends by position: each stretch of 0.1 s is replaced by the cubic of
least squares through it (Savitzky and Golay 1964), and Hermite's cubic joins angle and rate between samples.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import savgol_filter

from ...errors import InputError
from .vector import compiled

OPEN = 0.05
"""Angle up to which a ring counts as open [rad]."""
SMOOTHED = 0.1
"""[s]"""
PERIOD = 0.01
"""Of the table [s], at most."""


@compiled
def followed(time, start, period, table):
    """Angle [rad] and rate [rad/s] at a time; at rest before and after."""
    place = (time - start) / period
    last = table.shape[0] - 1
    if place <= 0.0:
        return table[0, 0], 0.0
    if place >= last:
        return table[last, 0], 0.0
    k = int(place)
    u = place - k
    a, b, c, d = table[k, 0], table[k, 1] * period, table[k + 1, 0], table[k + 1, 1] * period
    bend, twist = 3 * (c - a) - 2 * b - d, 2 * (a - c) + b + d
    return a + u * (b + u * (bend + u * twist)), (b + u * (2 * bend + 3 * u * twist)) / period


@dataclass(frozen=True, eq=False)
class RingDrive:
    """Angle and rate of the ring, every `period` [s] from `start` [s]: table (n, 2) [rad, rad/s]."""

    start: float
    period: float
    table: np.ndarray

    def __call__(self, time: float) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s] at a time."""
        return followed(time, self.start, self.period, self.table)

    @staticmethod
    def of_samples(times: ArrayLike, angles: ArrayLike) -> "RingDrive":
        """From a recording: times [s] that increase, angles [rad] counted from the open ring, closing.

        Raises
        ------
        InputError
            For a ring that is not open at the start, or less than eight samples or 0.2 s of it.
        """
        times, angles = np.asarray(times, float), np.asarray(angles, float)
        known = np.isfinite(angles)
        times, angles = times[known], angles[known]
        if len(times) < 8 or times[-1] - times[0] < 2 * SMOOTHED:
            raise InputError(f"angle.ring: {len(times)} samples; give eight and {2 * SMOOTHED:g} s of it, or more")
        angles = angles * (-1.0 if angles[-1] < angles[0] else 1.0)
        if abs(angles[0]) > OPEN:
            raise InputError(
                f"angle.ring is {angles[0]:.3g} rad at the start; give a recording that starts with the ring open, at 0"
            )
        period = min(PERIOD, float(np.median(np.diff(times))))
        count = int((times[-1] - times[0]) / period) + 1
        even = np.interp(times[0] + period * np.arange(count), times, angles)
        window = min(max(5, 2 * round(SMOOTHED / period / 2) + 1), 2 * ((count - 1) // 2) + 1)
        table = np.empty((count, 2))
        table[:, 0] = savgol_filter(even, window, 3)
        table[:, 1] = savgol_filter(even, window, 3, deriv=1, delta=period)
        table[:, 0] -= table[0, 0]
        table[0, 1] = 0.0
        return RingDrive(float(times[0]), period, table)
