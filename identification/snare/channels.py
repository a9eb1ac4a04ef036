"""Channels of a capture, measured and modelled, as results and pictures show them.

``pos.<body>.x`` and so on and ``force.<sensor>.x``, each as means over a quarter of a second. Errors of positions are
relative to the motion since the start: a position itself depends on where the origin is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .comparison import slow_means
from .fit import CaptureFit
from .recording import CaptureRecording, Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredChannel:
    """One channel of one capture, as it was measured: name, unit, times [s] and values, all (n,).

    ``place`` (n,) [m] is the measured position along the channel's axis, which pictures draw forces against.
    """

    name: str
    unit: str
    times: Array
    measured: Array
    place: Array

    def relative_to(self) -> Array:
        """What the RMS of an error is relative to: of a position, its motion."""
        return self.measured - self.measured[0] if self.unit == "m" else self.measured


@dataclass(frozen=True)
class ChannelError:
    """RMS of measurement less simulation on one channel over all captures, and of what that is relative to."""

    channel: str
    unit: str
    rms: float
    reference: float

    @property
    def relative(self) -> float:
        """Share of the reference."""
        return self.rms / max(self.reference, 1e-12)


def channels(capture: CaptureRecording) -> list[MeasuredChannel]:
    """Every channel of a capture."""
    times = slow_means(capture.times[:, None])[:, 0] + capture.zero
    seen = capture.measured
    place = slow_means(seen.position)
    found = [
        MeasuredChannel(f"pos.{capture.body}.{a}", "m", times, place[:, i], place[:, i]) for i, a in enumerate("xyz")
    ]
    for body, sensor in capture.sensors.items():
        force = slow_means(seen.force[body])
        found += [
            MeasuredChannel(f"force.{sensor}.{a}", "N", times, force[:, i], place[:, i]) for i, a in enumerate("xyz")
        ]
    return found


def modelled(capture: CaptureRecording, track: Track) -> list[Array]:
    """A capture's `channels` as a simulation has them, (n,) each."""
    found = [*slow_means(track.position).T]
    for body in capture.sensors:
        found += [*slow_means(track.force[body]).T]
    return found


def channel_errors(captures: Sequence[CaptureRecording], found: CaptureFit) -> list[ChannelError]:
    """The error of every channel that the captures have."""
    sums: dict[str, tuple[str, float, float, int]] = {}
    for c, track in zip(captures, found.tracks, strict=True):
        for channel, ours in zip(channels(c), modelled(c, track), strict=True):
            known = np.isfinite(channel.measured)
            left = float(np.sum((channel.measured - ours)[known] ** 2))
            size = float(np.nansum(channel.relative_to() ** 2))
            _, a, b, n = sums.get(channel.name, (channel.unit, 0.0, 0.0, 0))
            sums[channel.name] = (channel.unit, a + left, b + size, n + int(known.sum()))
    return [
        ChannelError(name, unit, float(np.sqrt(left / max(n, 1))), float(np.sqrt(size / max(n, 1))))
        for name, (unit, left, size, n) in sums.items()
    ]
