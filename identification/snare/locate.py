"""Where in a capture the misfit stands: which channel, when, and before or in contact."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...report.words import percent
from ..diagnosis import Location
from .channels import channels, modelled
from .comparison import QUARTER
from .recording import CaptureRecording
from .search import CaptureSelection

Array = NDArray[np.float64]

SMALLEST = 0.01
"""Channels with less of the energy are not listed; nor is a channel's own energy taken for less than this share of the
largest of its kind: small forces and motions along an axis are no place to look first."""
TOUCH, STANDS_OUT = 0.5, 8.0
"""A force is a touch from so many newtons, and so many standard deviations of its noise, on."""
MOST_WINDOWS = 6


def locate_capture(found: CaptureSelection, train: Sequence[CaptureRecording]) -> tuple[Location, ...]:
    """Channels of the first capture by the share of their own energy that is explained, or left without a name."""
    entries = []
    capture, before, after = train[0], found.first.tracks[0], found.last.tracks[0]
    for channel, a, b in zip(channels(capture), modelled(capture, before), modelled(capture, after), strict=True):
        change = np.nan_to_num(b - a if found.named else channel.measured - a)
        size = float(np.nansum(channel.relative_to() ** 2)) or 1.0
        whole = max(float(np.nansum(c.relative_to() ** 2)) for c in channels(capture) if c.unit == channel.unit)
        entries.append((float(np.sum(change**2)) / max(size, SMALLEST * whole, 1e-300), channel, change))
    total = sum(e for e, _, _ in entries)
    if total <= 0:
        return ()
    made = []
    touched = _touch(capture)
    for energy, channel, change in sorted(entries, key=lambda e: -e[0]):
        if energy / total < SMALLEST:
            break
        where = "throughout the capture"
        inside = float(np.sum(change[channel.times >= touched] ** 2)) / max(float(np.sum(change**2)), 1e-300)
        if np.isfinite(touched) and inside > 0.9:
            where = f"in contact, from {touched:.2f} s on ({percent(inside)} of it)"
        elif np.isfinite(touched) and inside < 0.5:
            where = f"before contact, until {touched:.2f} s ({percent(1 - inside)} of it)"
        made.append(Location(channel.name, float(energy / total), _windows(channel.times, change), where))
    return tuple(made)


def _touch(capture: CaptureRecording) -> float:
    """When a force first stands out of its start [s]; not a number without a sensor or a contact."""
    for body, force in capture.measured.force.items():
        size = np.linalg.norm(np.nan_to_num(force), axis=1)
        out = size > max(TOUCH, STANDS_OUT * capture.noise[body])
        if out.any():
            return float(capture.times[np.argmax(out)] + capture.zero)
    return float("nan")


def _windows(times: Array, change: Array) -> tuple[tuple[float, float], ...]:
    """Half seconds that hold the strongest half of a change, neighbours merged."""
    number = np.arange(len(change)) // 2
    energy = np.bincount(number, change**2)
    order = np.argsort(-energy)
    count = int(np.searchsorted(np.cumsum(energy[order]), 0.5 * energy.sum())) + 1
    chosen = np.zeros(len(energy) + 2, bool)
    chosen[order[:count] + 1] = True
    edges = np.flatnonzero(np.diff(chosen.astype(int)))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    spans = [(times[2 * a] - QUARTER / 2, times[min(2 * b, len(times)) - 1] + QUARTER / 2) for a, b in pairs]
    return tuple((round(float(a), 3), round(float(b), 3)) for a, b in spans[:MOST_WINDOWS])
