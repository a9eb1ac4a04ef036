"""The noise of one channel: white, coloured, wandering, of the encoders, of sticking near rest, and of vibration.

    K = w² I + a² c(|d|/τa) + m v e^(-|d|/τv) v m + encoders + s F (I + e^(-|d|/τh)) s F + diag((s' g)²) + vibration

Of white and coloured noise (`coloured`), of a level that wanders (`wander`), of the encoders (`encoder`), of joints
that stick and settle (`rest`), and of what vibrates at some speeds (`vibration`). `learn` finds the scales of the
first four.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..deciding import ODDS_OF_CURVES, WANDER_PRIOR
from .covariance import Covariance, LaggedNoise

Array = NDArray[np.float64]

HELD = 1.0
"""[s] Time over which a joint that stands holds the same torque."""

NEGLIGIBLE = 1e-2
"""Share of the independent variance below which noise of the encoders is left out: it would only cost time."""


@dataclass(frozen=True)
class NoiseChannel:
    """One channel of one recording, as its noise sees it: period [s], segments, noise of the encoders (n,) [T], shares
    of every sample near rest (n,), for each width that this may have, and about it, the level [T] that a joint may hold
    at rest, and where it may wander, m (n,), 0 to 1: everywhere if it is not given. ``pace``: its joint's speed [share
    of the peak speed] (n,); without it nothing vibrates."""

    step: float
    segments: tuple[slice, ...]
    encoder: Array
    sticks: tuple[Array, ...]
    settles: Array
    level: float
    wanders: Array | float = 1.0
    pace: Array | None = None

    def some(self, rows: slice) -> "NoiseChannel":
        """The first samples of this channel."""
        inside = tuple(slice(s.start, min(s.stop, rows.stop)) for s in self.segments if s.start < rows.stop)
        sticks = tuple(x[rows] for x in self.sticks)
        wanders = self.wanders[rows] if isinstance(self.wanders, np.ndarray) else self.wanders
        pace = None if self.pace is None else self.pace[rows]
        settles = self.settles[rows]
        return NoiseChannel(self.step, inside, self.encoder[rows], sticks, settles, self.level, wanders, pace)


def bell(run: NoiseChannel, pace: float, wide: float) -> Array:
    """How near each sample's speed is to a pace, both as shares of the peak speed (n,): 1 there, less about it, and 0
    near rest, where a joint sticks and settles."""
    if run.pace is None:
        return np.zeros(run.encoder.shape)
    return (1 - run.settles) * np.exp(-0.5 * ((run.pace - pace) / wide) ** 2)


@dataclass(frozen=True)
class Vibration:
    """Standard deviation ``level`` [T] at a share ``pace`` of the joint's peak speed, less about it, by a bell of the
    deviation ``wide``, which is infinite if it is the same at any speed; ``frequency`` [Hz], and ``decay`` [s]. Of so
    many ``trials`` it is the best, and the noise is ``without`` it else."""

    level: float
    frequency: float
    decay: float
    pace: float
    wide: float
    trials: float = 1.0
    without: "Noise | None" = None

    @property
    def steady(self) -> bool:
        """Whether it is the same at any speed."""
        return bool(np.isinf(self.wide))

    def process(self, run: NoiseChannel) -> LaggedNoise:
        """What it is in a recording."""
        return LaggedNoise(self.level * bell(run, self.pace, self.wide), self.decay, 2, self.frequency)


@dataclass(frozen=True)
class Noise:
    """Scales of a channel's noise [T; s]."""

    white: float
    coloured: float
    coloured_time: float
    wander: float
    wander_time: float
    settling: float
    unit: float = 1.0
    """RMS of the residual that they were learnt from [T]."""
    width: int = 0
    """Which of the widths near rest."""
    order: int = 1
    """Of the coloured noise."""
    odds: float = ODDS_OF_CURVES
    """Prior odds that it wanders, that it is smooth, and that it vibrates."""
    vibration: Vibration | None = None

    @property
    def still(self) -> "Noise":
        """The noise that it would be if it did not vibrate at some speeds."""
        v = self.vibration
        return self if v is None or v.steady or v.without is None else v.without

    @property
    def plain(self) -> "Noise":
        """The noise that it would be if it did not vibrate at all."""
        return self if self.vibration is None or self.vibration.without is None else self.vibration.without.plain

    @property
    def log_prior(self) -> float:
        """Log prior of its wander, of its vibration, and of its being smooth."""
        odds = float(np.log(self.odds))
        wanders = odds - WANDER_PRIOR * self.wander / self.unit if self.wander else 0.0
        vibrates = odds - float(np.log(self.vibration.trials)) if self.vibration else 0.0
        return wanders + vibrates + (odds if self.order > 1 else 0.0)

    def covariance(self, run: NoiseChannel) -> Covariance:
        """K of a recording."""
        sticks = run.sticks[self.width]
        variance = self.white**2 + (run.level * sticks) ** 2 + (self.settling * run.settles) ** 2
        held = LaggedNoise(run.level * sticks, HELD)
        processes = [
            LaggedNoise(self.coloured, self.coloured_time, self.order),
            LaggedNoise(self.wander * run.wanders, self.wander_time),
            held,
        ]
        if self.vibration is not None:
            processes.append(self.vibration.process(run))
        heard = np.any(run.encoder**2 >= NEGLIGIBLE * variance)
        return Covariance(variance, processes, run.encoder if heard else None, run.step, run.segments)
