"""Where in a capture the misfit stands: which channel, when, and before or in contact."""

import numpy as np
from numpy.typing import NDArray

from ...report.words import percent
from ..diagnosis import Location
from ..sources.decide import SourceDecision
from .recording import CaptureRecording
from .seen import QUARTER, shown, times
from .source import Captures

Array = NDArray[np.float64]

SMALLEST = 0.01
"""Channels with less of the energy are not listed."""
TOUCH, STANDS_OUT = 0.5, 8.0
"""A force is a touch from so many newtons, and so many standard deviations of its noise, on."""
MOST_WINDOWS = 6


def locate_capture(source: Captures, decided: SourceDecision) -> tuple[Location, ...]:
    """Channels of the first capture by the share of their own energy that is explained, or left without a name."""
    capture, before, after = (
        source.records[0],
        decided.found.first.train.residuals[0],
        decided.train.residuals[0],
    )
    own = shown(source.channels)
    change = before - after if decided.best.names else after
    energy = np.zeros(len(source.channels))
    energy[own] = (np.sum(change**2, axis=0) / source.scale() ** 2)[own]
    total, touched, made = float(energy.sum()), _touch(capture), []
    clock = times(capture)
    for c in np.argsort(-energy):
        if total <= 0 or energy[c] < SMALLEST * total:
            break
        where, x = "throughout the capture", change[:, c]
        inside = float(np.sum(x[clock >= touched] ** 2)) / max(float(np.sum(x**2)), 1e-300)
        if np.isfinite(touched) and inside > 0.9:
            where = f"in contact, from {touched:.2f} s on ({percent(inside)} of it)"
        elif np.isfinite(touched) and inside < 0.5:
            where = f"before contact, until {touched:.2f} s ({percent(1 - inside)} of it)"
        made.append(Location(source.channels[c], float(energy[c] / total), _windows(clock, x), where))
    return tuple(made)


def _touch(capture: CaptureRecording) -> float:
    """When a force first stands out of its start [s]; not a number without a sensor or a contact."""
    for body, force in capture.measured.force.items():
        size = np.linalg.norm(np.nan_to_num(force), axis=1)
        out = size > max(TOUCH, STANDS_OUT * capture.noise[body])
        if out.any():
            return float(capture.times[np.argmax(out)] + capture.zero)
    return float("nan")


def _windows(clock: Array, change: Array) -> tuple[tuple[float, float], ...]:
    """Half seconds that hold the strongest half of a change, neighbours merged."""
    number = np.arange(len(change)) // 2
    energy = np.bincount(number, change**2)
    order = np.argsort(-energy)
    count = int(np.searchsorted(np.cumsum(energy[order]), 0.5 * energy.sum())) + 1
    chosen = np.zeros(len(energy) + 2, bool)
    chosen[order[:count] + 1] = True
    edges = np.flatnonzero(np.diff(chosen.astype(int)))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    spans = [(clock[2 * a] - QUARTER / 2, clock[min(2 * b, len(clock)) - 1] + QUARTER / 2) for a, b in pairs]
    return tuple((round(float(a), 3), round(float(b), 3)) for a, b in spans[:MOST_WINDOWS])
