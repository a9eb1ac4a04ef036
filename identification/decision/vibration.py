"""Vibration that the held-out recordings confirm: physics without a law, told by its size, frequency and speeds."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from ..deciding import DISCREPANCY, GATE
from ..evidence.members import left_by
from .kind import RecordingKind
from .selection import F, Selection


@dataclass(frozen=True)
class ToldVibration:
    """Frequency [Hz], the speeds at which it is more than half as strong as at most [shares of the peak speed], the
    share of the channel's residual that it is [0 to 1], and the held-out recordings' gain by it [deviations of a normal
    error that is as rare]."""

    frequency: float
    slow: float
    fast: float
    explained: float
    held: float


def vibrations(kind: RecordingKind[F], found: Selection[F]) -> Mapping[int, ToldVibration]:
    """Of every channel whose noise vibrates at some speeds, if it does in the held-out recordings too.

    Without it the noise is the likeliest of the training recordings by itself, or that which was beside the vibration:
    the held-out recordings may be quieter as a whole. Were either noise the true one, the chance that their density is
    G nats higher with the vibration would be at most e^(-G) (Markov's inequality); real noise is neither. The block of
    time that gains most does not count: what occurs once, as a knock does, follows no speed.
    """
    noises, told = found.weighed.noises, dict[int, ToldVibration]()
    if not any(x.vibration for x in noises):
        return told
    left = left_by(found.search.on, [(s.taken.item, s.taken.size) for s in found.slots], [*kind.train, *kind.held])
    for c, noise in enumerate(noises):
        v = noise.vibration
        if v is None or v.steady:
            continue
        with_it, *without = (
            np.concatenate(
                [kind.blocks(i, x.covariance(found.weighed.runs[i][c]).log_density(left[i][:, c])) for i in kind.held]
            )
            for x in (noise, noise.still, replace(noise, vibration=None))
        )
        gains = [with_it - x for x in without]
        held = float(norm.isf(np.exp(-max(min(x.sum() - x.max() for x in gains), 0.0))))
        energy = np.concatenate([np.square(v.process(found.weighed.runs[i][c]).level) for i in kind.train])
        whole = np.concatenate([left[i][:, c] ** 2 for i in kind.train])
        if held > GATE and np.sqrt(energy.mean()) >= DISCREPANCY * found.weighed.scale[c]:
            reach = v.wide * np.sqrt(2 * np.log(2))
            share = min(float(energy.mean() / whole.mean()), 1.0)
            told[c] = ToldVibration(v.frequency, max(v.pace - reach, 0.0), min(v.pace + reach, 1.0), share, held)
    return told
