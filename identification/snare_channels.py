"""Channels of a capture, measured and modelled, as results and pictures show them.

``pos.<body>.x`` and so on and ``force.<sensor>.x``, each as means over a quarter of a second.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .snare_fit import SLOW, Fit
from .snare_recording import Capture, Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """One channel of one capture: name, unit, and over its times (n,) what was measured and what a track has."""

    name: str
    unit: str
    times: Array
    measured: Array
    place: Array

    def relative_to(self) -> Array:
        """What the RMS of a misfit is relative to: of a position, its motion."""
        return self.measured - self.measured[0] if self.unit == "m" else self.measured


def channels(capture: Capture) -> list[Channel]:
    """Every channel of a capture."""
    times = _means(capture.times[:, None])[:, 0] + capture.zero
    seen = capture.measured
    place = _means(seen.position)
    found = [Channel(f"pos.{capture.body}.{a}", "m", times, place[:, i], place[:, i]) for i, a in enumerate("xyz")]
    for body, sensor in capture.sensors.items():
        force = _means(seen.force[body])
        found += [Channel(f"force.{sensor}.{a}", "N", times, force[:, i], place[:, i]) for i, a in enumerate("xyz")]
    return found


def modelled(capture: Capture, track: Track) -> list[Array]:
    """The same channels of a simulation."""
    found = [*_means(track.position).T]
    for body in capture.sensors:
        found += [*_means(track.force[body]).T]
    return found


def _means(x: Array) -> Array:
    return x[: len(x) // SLOW * SLOW].reshape(-1, SLOW, x.shape[1]).mean(1)


def misfits(captures: Sequence[Capture], found: Fit) -> list[tuple[str, str, float, float]]:
    """Name, unit, RMS misfit and RMS of what it is relative to, of every channel over all captures."""
    sums: dict[str, tuple[str, float, float, int]] = {}
    for c, track in zip(captures, found.tracks, strict=True):
        for channel, ours in zip(channels(c), modelled(c, track), strict=True):
            known = np.isfinite(channel.measured)
            left = float(np.sum((channel.measured - ours)[known] ** 2))
            size = float(np.nansum(channel.relative_to() ** 2))
            _, a, b, n = sums.get(channel.name, (channel.unit, 0.0, 0.0, 0))
            sums[channel.name] = (channel.unit, a + left, b + size, n + int(known.sum()))
    return [(name, u, np.sqrt(a / max(n, 1)), np.sqrt(b / max(n, 1))) for name, (u, a, b, n) in sums.items()]
