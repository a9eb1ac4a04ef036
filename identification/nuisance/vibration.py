"""Vibration of a joint at some of its speeds: gears that chatter, a structure that teeth make ring.

    r_t = level · exp(-(|q̇_t| / q̇_max - pace)² / (2 wide²)) · x_t

with x an oscillator of unit variance that white noise shakes, ``frequency`` f and ``decay`` τ (Box and Jenkins 1976,
chapter 3). Its phase is nobody's law: a joint's own motion tells when it vibrates, how fast and how strongly, and no
more. So it is noise, and what is told of it is its size. The level, frequency and decay are those of highest marginal
likelihood, beside white and coloured noise that are learnt anew: alone, they would have had to hold the vibration.

One at any speed competes: a line of the spectrum that is a servo's resonance, or where a disturbance ends, and no
physics.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..deciding import (
    VIBRATION_DAMPING,
    VIBRATION_PACES,
    VIBRATION_RESOLVED,
    VIBRATION_SLOWEST,
    VIBRATION_WIDTHS,
)
from .likelihood import Cost, lowest
from .noise import Noise, NoiseChannel, Vibration, bell

Array = NDArray[np.float64]

ANY = ((0.0, np.inf),)
"""A pace that is as wide as can be."""

SPACING = 0.05
"""[Hz] Between the frequencies that are tried."""

LONGEST = 8.0
"""[s] Longest decay."""

OWN_WIDE = np.array([1.5, 1.5, 1.0])
"""Prior deviations of the logarithms of white and coloured noise, and of the latter's time."""

STARTS = tuple(product(((1.0, 0.3), (1.0, 1.0), (0.5, 1.0), (0.25, 1.0)), (0.0, 2.0)))
"""Where the search starts: the other noise, and the vibration [shares of the noise, and of the residual's RMS]; and its
decay, which is at least the least [s]."""


def vibrating(residuals: Sequence[Array], runs: Sequence[NoiseChannel], noise: Noise) -> Noise:
    """A channel's noise with the vibration that is likeliest, at some speeds or at any; without, where none gains.

    Parameters
    ----------
    residuals : sequence of array (n,)
        What all that was found leaves of each recording [T].
    runs : sequence of NoiseChannel
    noise : Noise
        Of the channel; what it says of sticking, of wander and of the encoders stays.
    """
    if all(run.pace is None for run in runs):
        return noise
    noise = replace(noise, vibration=None) if noise.vibration else noise
    look = _Look(residuals, runs, noise)
    some, any_speed = look.vibrating(tuple(product(VIBRATION_PACES, VIBRATION_WIDTHS))), look.vibrating(ANY)
    if some is None and any_speed is None:
        return noise
    # What is only learnt anew gains without a vibration, too.
    best = min((noise, look.still()), key=look.cost)
    for x in (any_speed, some):
        if x is not None and x.vibration is not None and look.cost(x) < look.cost(best):
            best = replace(x, vibration=replace(x.vibration, without=best))
    return best if best.vibration else noise


class _Look:
    """A search for the scales of a channel's noise, with vibration and without."""

    def __init__(self, residuals: Sequence[Array], runs: Sequence[NoiseChannel], noise: Noise) -> None:
        self._residuals, self._runs, self._noise = residuals, runs, noise
        parts = [(r[:, None], run) for r, run in zip(residuals, runs, strict=True)]
        self._likelihood = Cost(parts)
        self._size = float(np.std(np.concatenate(list(residuals)))) + 1e-12
        self._band = VIBRATION_RESOLVED / max(run.step for run in runs) - VIBRATION_SLOWEST
        self._own = np.log([noise.white, max(noise.coloured, 1e-3 * self._size), noise.coloured_time])

    def cost(self, noise: Noise) -> float:
        """Minus the log of likelihood and prior."""
        return self._likelihood(noise, 0.0) - noise.log_prior

    def still(self) -> Noise:
        """White and coloured noise learnt anew, where nothing vibrates."""
        return self._scaled(lowest(lambda x: self.cost(self._scaled(x)), self._own, OWN_WIDE, *self._bounds()))

    def vibrating(self, speeds: Sequence[tuple[float, float]]) -> Noise | None:
        """With the likeliest vibration at one of some speeds; None where none gains anything to start with."""
        noise, tried = self._noise, []
        for (pace, wide), hertz in zip(speeds, _loudest(self._residuals, self._runs, noise, speeds), strict=True):
            for (quiet, loud), decay in STARTS:
                v = Vibration(loud * self._size, hertz, max(decay, _least_decay(hertz)), pace, wide)
                other = replace(noise, white=quiet * noise.white, coloured=quiet * noise.coloured, vibration=v)
                tried.append((self.cost(other), quiet, v))
        least, quiet, start = min(tried, key=lambda t: t[0])
        if least >= self.cost(noise):
            return None
        beside = np.log([start.level, start.frequency, start.decay])

        def shaken(x: Array) -> Noise:
            level, hertz, decay = (float(v) for v in np.exp(x[3:]))
            decay = max(decay, _least_decay(hertz))
            trials = len(speeds) * max(self._band * decay, 1.0)
            made = replace(start, level=level, frequency=hertz, decay=decay, trials=trials)
            return replace(self._scaled(x[:3]), vibration=made)

        low, high = self._bounds()
        low = np.concatenate([low, beside + np.log([1e-3, 0.8, 0.1])])
        high = np.concatenate([high, beside + np.log([5.0, 1.25, LONGEST / start.decay])])
        begin = np.concatenate([self._own + np.log([quiet, quiet, 1.0]), beside])
        wide = np.concatenate([OWN_WIDE, [2.0, 10.0, 1.0]])
        return shaken(lowest(lambda x: self.cost(shaken(x)), begin, wide, low, high))

    def _scaled(self, x: Array) -> Noise:
        white, coloured, time = (float(v) for v in np.exp(x))
        return replace(self._noise, white=white, coloured=coloured, coloured_time=time)

    def _bounds(self) -> tuple[Array, Array]:
        return self._own - np.array([4.0, 4.0, 1.6]), self._own + np.array([1.5, 1.5, 1.6])


def _least_decay(hertz: float) -> float:
    return 1 / (2 * np.pi * VIBRATION_DAMPING * hertz)


def _loudest(
    residuals: Sequence[Array], runs: Sequence[NoiseChannel], noise: Noise, speeds: Sequence[tuple[float, float]]
) -> Array:
    """The strongest frequency of the white residual at each pace and width [Hz]."""
    top = VIBRATION_RESOLVED / max(run.step for run in runs)
    hertz = np.arange(VIBRATION_SLOWEST, max(top, VIBRATION_SLOWEST + SPACING), SPACING)
    power = np.zeros((len(hertz), len(speeds)))
    for r, run in zip(residuals, runs, strict=True):
        white = noise.covariance(run).white(r[:, None])
        some = np.stack([bell(run, pace, wide) for pace, wide in speeds], axis=1)
        turns = np.exp(-2j * np.pi * run.step * np.outer(hertz, np.arange(len(r))))
        power += np.abs(turns @ (white * some)) ** 2
    return hertz[np.argmax(power, axis=0)]
