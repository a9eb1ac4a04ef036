"""Sticking: near rest a joint holds any torque up to its level, and no law of speed predicts which.

A sign that is sampled, or rounded over a small speed, says it wrong, and so does any law of what moves. There the
torque is free: a sample of which the share s stands near rest has, beside all else, the variance (s F)², F the level
of dry friction (known), and just outside that the variance (s' g)², g estimated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...recordings.condition import Motion
from .. import deciding

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Zone:
    """What counts as near rest: below ``speed``, a share of the joint's peak speed, or within ``travel``, a share of
    the joint's travel, after it stood."""

    speed: float
    travel: float


STICKS = tuple(Zone(*x) for x in deciding.STICKS)
SETTLES = Zone(*deciding.SETTLES)


def share(motion: Motion, along: Array, zone: Zone, peak: float, travel: float) -> Array:
    """Share of each sample in the analysis band that is near rest (n_band,), 0 to 1.

    Parameters
    ----------
    motion : Motion
    along : array (J,)
        The joint, or an axis of several: its coordinate is the sum of along[j] q[j].
    zone : Zone
    peak, travel : float
        Its peak speed and travel over the training recordings.
    """
    speed = motion.qd @ along
    slow = np.abs(speed) < zone.speed * peak + 2 * np.linalg.norm(motion.encoder_noise[1] * along)
    slow[:-1] |= speed[:-1] * speed[1:] < 0
    reach = zone.travel * travel
    for s in motion.segments:
        gone = np.concatenate([[0.0], np.cumsum(np.abs(speed[s]))]) * motion.period
        for t in np.flatnonzero(slow[s][:-1] & ~slow[s][1:]) + 1:
            slow[s.start + t : s.start + int(np.searchsorted(gone[: s.stop - s.start], gone[t] + reach))] = True
    return np.clip(motion.to_band(slow.astype(float)), 0.0, 1.0)
