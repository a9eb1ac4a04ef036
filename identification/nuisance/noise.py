"""The noise of one channel: white, coloured, wandering, of the encoders, and of sticking near rest.

    K = w² I + a² c(|d|/τa) + m v e^(-|d|/τv) v m + encoders + s F (I + e^(-|d|/τh)) s F + diag((s' g)²)

Of white and coloured noise (`coloured`), of a level that wanders (`wander`), of the encoders (`encoder`), and of joints
that stick and settle (`rest`). `learn` finds the scales.
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
    at rest, and where it may wander, m (n,), 0 to 1: everywhere if it is not given."""

    step: float
    segments: tuple[slice, ...]
    encoder: Array
    sticks: tuple[Array, ...]
    settles: Array
    level: float
    wanders: Array | float = 1.0

    def some(self, rows: slice) -> "NoiseChannel":
        """The first samples of this channel."""
        inside = tuple(slice(s.start, min(s.stop, rows.stop)) for s in self.segments if s.start < rows.stop)
        sticks = tuple(x[rows] for x in self.sticks)
        wanders = self.wanders[rows] if isinstance(self.wanders, np.ndarray) else self.wanders
        return NoiseChannel(self.step, inside, self.encoder[rows], sticks, self.settles[rows], self.level, wanders)


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
    """Prior odds that it wanders, and that it is smooth."""

    @property
    def log_prior(self) -> float:
        """Log prior of its wander, and of its being smooth."""
        odds = float(np.log(self.odds))
        wanders = odds - WANDER_PRIOR * self.wander / self.unit if self.wander else 0.0
        return wanders + (odds if self.order > 1 else 0.0)

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
        heard = np.any(run.encoder**2 >= NEGLIGIBLE * variance)
        return Covariance(variance, processes, run.encoder if heard else None, run.step, run.segments)
