"""Noise model of each channel: an autoregression fitted to what the *saturated* model leaves over.

Saturated means baseline, every candidate and smooth curves together: fitted to the baseline's own residual, the
noise model would learn the missing physics and then whiten it away.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

LONGEST = 12
"""Highest order tried; the order is chosen by BIC."""

MOST_MISSING = 0.5
"""Share of missing samples beyond which the noise is learnt from all of them, as it is where the others stand in pieces
shorter than its memory."""


@dataclass(frozen=True)
class Whitener:
    """Autoregression of one channel: ``coefficients`` (order,) and the innovations' RMS [channel's unit].

    ``lead`` samples at the head of each segment are given up, since their past is unknown.
    """

    coefficients: Array
    sigma: float
    lead: int

    def __call__(self, x: Array, segments: Sequence[slice]) -> Array:
        """Innovations in units of their RMS: (n_band, ...) to (n_white, ...)."""
        taps = np.concatenate([[1.0], -self.coefficients]) / self.sigma
        parts = [x[s] for s in segments]  # SciPy refuses to filter no columns; a baseline at its bounds has none
        return np.concatenate([(lfilter(taps, [1.0], p, axis=0) if p.size else p)[self.lead :] for p in parts])


def whitener(
    residual: Array, columns: Array, segments: Sequence[slice], missing: NDArray[np.bool_] | None = None
) -> tuple[Whitener, Array]:
    """Fit the noise model of a channel.

    Parameters
    ----------
    residual : array (n_band,)
        The channel's residual under the baseline.
    columns : array (n_band, k)
        Everything that could explain it.
    segments : sequence of slice
        Runs without a gap.
    missing : array (n_band,), optional
        Samples that are no noise; nothing is learnt from them, unless little else is there.

    Returns
    -------
    Whitener and the innovations (n_white,), in units of their RMS.
    """
    scale = np.sqrt(np.mean(columns**2, axis=0))
    use = columns[:, scale > 0] / scale[scale > 0]
    ridge = 1e-3 * np.sqrt(len(residual)) * np.eye(use.shape[1])
    good = np.ones(len(residual), bool) if missing is None or np.mean(missing) > MOST_MISSING else ~missing
    padded = np.concatenate([residual[good], np.zeros(len(ridge))])
    noise = residual - use @ np.linalg.lstsq(np.vstack([use[good], ridge]), padded, rcond=None)[0]
    # Long runs tell the memory apart from the ends; short ones serve where there is nothing else.
    kept = [s for s in segments if s.stop - s.start > 4 * LONGEST] or [
        s for s in segments if s.stop - s.start > LONGEST
    ]
    known = np.concatenate([np.convolve(~good[s], np.ones(LONGEST + 1), mode="valid") == 0 for s in kept])
    if np.count_nonzero(known) < 4 * LONGEST < len(known):
        return whitener(residual, columns, segments)
    best: tuple[float, NDArray, float] | None = None
    for order in range(LONGEST + 1):
        past = np.concatenate([_lagged(noise[s], order)[LONGEST - order :] for s in kept])
        now = np.concatenate([noise[s][LONGEST:] for s in kept])
        past, now = past[known], now[known]
        a = np.asarray(np.linalg.lstsq(past, now, rcond=None)[0], float) if order else np.zeros(0)
        variance = float(np.mean((now - past @ a) ** 2))
        score = len(now) * np.log(variance + 1e-300) + order * np.log(len(now))
        if best is None or score < best[0]:
            best = (score, a, variance)
    assert best is not None
    # Columns were fitted too: the innovations' variance is per degree of freedom left.
    n_good = int(np.count_nonzero(good))
    freedom = max(n_good - use.shape[1], n_good // 4)
    sigma = float(np.sqrt(best[2] * n_good / freedom)) + 1e-15
    found = Whitener(best[1], sigma, LONGEST)
    return found, found(noise, segments)


def _lagged(x: Array, order: int) -> Array:
    """Rows (x[n-1], ..., x[n-order]) for n >= order: (len(x) - order, order)."""
    return np.stack([x[order - k - 1 : len(x) - k - 1] for k in range(order)], 1) if order else np.zeros((len(x), 0))
