"""Vibration that comes and goes: a residual that is far stronger at some times than its noise is at most other times.

What a model leaves out goes with a state of the arm; a disturbance or a noise is as strong at one time as at another.
What does neither has no law in the joint's own motion to be named by: how much, when, and how fast is all there is to
say of it. Its strength is counted in units of the noise K, so that encoders and sticking do not count: the mean of
e (K⁻¹ e) over a window.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import periodogram

from ..deciding import BURST_LOUD, BURST_SHARE, BURST_WINDOW

Array = NDArray[np.float64]

FEWEST = 12
"""Windows of which a median says something."""

LEAST = 0.25
"""Share of a window in motion of which a mean says something."""


@dataclass(frozen=True)
class ChannelResidual:
    """The remaining residual of one channel of one recording (n,) [T], its part of e' K⁻¹ e (n,), whether a sample is
    far from rest (n,), and the period [s].
    """

    residual: Array
    energy: Array
    moves: NDArray[np.bool_]
    step: float


@dataclass(frozen=True)
class Bursts:
    """The share of the residual's energy that is out of the ordinary [0 to 1], its frequency [Hz], and whether bursts
    come again, in the held-out recordings too."""

    share: float
    frequency: float
    again: bool


def bursts(train: Sequence[ChannelResidual], held: Sequence[ChannelResidual]) -> Bursts | None:
    """Whether one channel's residual comes in bursts: `BURST_SHARE` of it above `BURST_LOUD` times the median window.

    A window is weighted by its time in motion. Bursts recur if as much is left without the loudest window, and if the
    held-out recordings have them too: what occurs once, as a knock does, follows no law of the arm.
    """
    over, whole, parts = _windows(train)
    if (share := _share(over, whole)) <= BURST_SHARE:
        return None
    once = int(np.argmax(over))
    f, power = periodogram(parts[once][0], parts[once][1], window="hann", nfft=1024)
    if f[np.argmax(power)] < 1 / BURST_WINDOW:
        return None  # no window holds a period of it
    again = _share(np.delete(over, once), np.delete(whole, once)) > BURST_SHARE
    return Bursts(share, float(f[np.argmax(power)]), again and _share(*_windows(held)[:2]) > BURST_SHARE)


def _windows(channel: Sequence[ChannelResidual]) -> tuple[Array, Array, list[tuple[Array, float]]]:
    """What every window has above the ordinary, and its whole energy, both (n,), and its residual and rate [Hz]; none
    where there are too few."""
    strength, weight, parts = [], [], []
    for own in channel:
        length = max(round(BURST_WINDOW / own.step), 2)
        for k in range(0, len(own.residual) - length + 1, length):
            moves = own.moves[k : k + length]
            if np.mean(moves) >= LEAST:
                strength.append(float(np.mean(own.energy[k : k + length][moves])))
                weight.append(float(np.mean(moves)))
                parts.append((own.residual[k : k + length], 1 / own.step))
    if len(strength) < FEWEST:
        return np.zeros(0), np.zeros(0), []
    z = np.maximum(np.array(strength), 0.0)
    return np.array(weight) * np.maximum(z - BURST_LOUD * np.median(z), 0.0), np.array(weight) * z, parts


def _share(over: Array, strength: Array) -> float:
    return float(over.sum() / max(strength.sum(), 1e-300))
