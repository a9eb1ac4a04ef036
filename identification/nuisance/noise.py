"""The noise of one channel: white, coloured, wandering, of the encoders, and of sticking near rest.

    K = w² I + a² e^(-|d|/τa) + m v e^(-|d|/τv) v m + encoders + s F (I + e^(-|d|/τh)) s F + diag((s' g)²)

The scales are those of highest marginal likelihood beside everything that could explain the residual: beside the
baseline alone the noise would learn the missing physics, and then hide it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from ..deciding import ODDS_OF_CURVES, WANDER_PRIOR, WANDER_TIMES
from .covariance import Covariance, FirstOrderNoise

Array = NDArray[np.float64]

HELD = 1.0
"""[s] Time over which a joint that stands holds the same torque."""

NEGLIGIBLE = 1e-2
"""Share of the independent variance below which noise of the encoders is left out: it would only cost time."""

STRETCH = 800
"""Samples that the fast scales are learnt from."""

AVERAGED = 0.25
"""[s] Blocks whose means the wander is learnt from."""


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
    odds: float = ODDS_OF_CURVES
    """Prior odds that it wanders."""

    @property
    def log_prior(self) -> float:
        """Log prior of its wander."""
        return float(np.log(self.odds)) - WANDER_PRIOR * self.wander / self.unit if self.wander else 0.0

    def covariance(self, run: NoiseChannel) -> Covariance:
        """K of a recording."""
        sticks = run.sticks[self.width]
        variance = self.white**2 + (run.level * sticks) ** 2 + (self.settling * run.settles) ** 2
        held = FirstOrderNoise(run.level * sticks, HELD)
        processes = [
            FirstOrderNoise(self.coloured, self.coloured_time),
            FirstOrderNoise(self.wander * run.wanders, self.wander_time),
            held,
        ]
        heard = np.any(run.encoder**2 >= NEGLIGIBLE * variance)
        return Covariance(variance, processes, run.encoder if heard else None, run.step, run.segments)


def learn(
    residuals: Sequence[Array],
    columns: Sequence[Array],
    runs: Sequence[NoiseChannel],
    *,
    freely: bool = False,
    channels: int = 1,
) -> Noise:
    """The noise of one channel: its fast scales on a stretch of the recordings, its wander on averages over blocks.

    Parameters
    ----------
    residuals : sequence of array (n,)
        Of each recording, under the baseline.
    columns : sequence of array (n, k)
        What could explain them, of about unit RMS.
    runs : sequence of NoiseChannel
    freely : bool
        Whether the columns may explain as much as they can. Otherwise their amplitudes have a common prior deviation,
        estimated beside the noise: where nothing is missing it is small, and nothing of the noise is lost to them.
    channels : int
        How many share the prior odds that something wanders, which are those of nameless physics.
    """
    odds = ODDS_OF_CURVES / channels
    whole = np.concatenate(list(residuals))
    size, most = float(np.std(whole)) + 1e-12, float(np.sqrt(np.mean(whole**2))) + 1e-12
    stretch = [slice(0, min(len(r), max(STRETCH // len(runs), 100))) for r in residuals]
    parts = [
        # Whatever is slow there is no matter of the fast scales.
        (_beside(r[rows], c[rows]), replace(run.some(rows), wanders=1.0))
        for r, c, run, rows in zip(residuals, columns, runs, stretch, strict=True)
    ]

    def fast(x: Array) -> tuple[Noise, float]:
        white, coloured, time, settling, slow = np.exp(x[:5])
        scales = float(white) + 1e-3 * size, float(coloured), float(time), float(slow), WANDER_TIMES[-1]
        return Noise(*scales, float(settling)), most if freely else float(np.exp(x[5]))

    start = np.log([0.3 * size, 0.3 * size, 0.1, 0.2 * size, size, 0.1 * size])
    wide = np.array([1.5, 1.5, 1.0, 2.0, 2.0, 2.0])
    low, high = start - 6, start + np.array([2.0, 2.0, 1.6, 3.0, 2.0, 3.0])
    low[2] = np.log(0.02)
    own = slice(0, 5 if freely else 6)
    found, _ = fast(_best(lambda x: _cost(fast(x), parts), start[own], wide[own], low[own], high[own]))
    averaged = [_averaged(r, c, run) for r, c, run in zip(residuals, columns, runs, strict=True)]
    own = slice(0, 2 if freely else 3)
    start, wide = np.log(np.array([0.3, 0.1]) * size)[: 1 if freely else 2], np.array([1.5, 2.0])[: 1 if freely else 2]

    def still(x: Array) -> float:
        noise = Noise(float(np.exp(x[0])) + 1e-3 * size, 0.0, 1.0, 0.0, WANDER_TIMES[0], 0.0)
        return _cost((noise, most if freely else float(np.exp(x[1]))), averaged)

    x = _best(still, start, wide, start - 6, start + 3)
    best = (still(x) + float(np.log(odds)), 0.0, WANDER_TIMES[0])
    for time in WANDER_TIMES:

        def slow(x: Array, time: float = time) -> tuple[Noise, float]:
            white, wander = np.exp(x[:2])
            spread = most if freely else float(np.exp(x[2]))
            return Noise(float(white) + 1e-3 * size, 0.0, 1.0, float(wander), time, 0.0), spread

        def cost(x: Array, slow: Callable[[Array], tuple[Noise, float]] = slow) -> float:
            return _cost(slow(x), averaged) + WANDER_PRIOR * float(np.exp(x[1])) / size

        for level in (0.01, 0.4):
            start = np.log(np.array([0.3, level, 0.1]) * size)[own]
            x = _best(cost, start, np.array([1.5, 10.0, 2.0])[own], start - 6, start + 3)
            best = min(best, (cost(x), float(np.exp(x[1])), time))
    return replace(found, wander=best[1], wander_time=best[2], unit=size, odds=odds)


def _best(cost: Callable[[Array], float], start: Array, wide: Array, low: Array, high: Array) -> Array:
    """Where a cost, with a normal prior of its logarithmic scales, is lowest."""

    def whole(x: Array) -> float:
        return cost(x) + 0.5 * float(np.sum(((x - start) / wide) ** 2))

    bounds = list(zip(low, high, strict=True))
    return minimize(whole, start, method="L-BFGS-B", bounds=bounds, options={"maxiter": 30, "eps": 1e-3}).x


def _beside(residual: Array, columns: Array) -> Array:
    """A residual and what could explain it (n, 1 + k), each column's samples side by side."""
    return np.asfortranarray(np.column_stack([residual, columns]))


def _averaged(residual: Array, columns: Array, run: NoiseChannel) -> tuple[Array, NoiseChannel]:
    """Means over blocks of `AVERAGED` seconds: what is faster becomes white."""
    length = max(int(AVERAGED / run.step), 1)
    starts, segments, count = [], [], 0
    for s in run.segments:
        own = np.arange(s.start, s.stop - length + 1, length)
        starts.append(own)
        segments.append(slice(count, count + len(own)))
        count += len(own)
    rows = np.concatenate(starts)[:, None] + np.arange(length)
    sticks, settles = tuple(x[rows].mean(axis=1) for x in run.sticks), run.settles[rows].mean(axis=1)
    wanders = run.wanders[rows].mean(axis=1) if isinstance(run.wanders, np.ndarray) else run.wanders
    other = NoiseChannel(run.step * length, tuple(segments), np.zeros(count), sticks, settles, run.level, wanders)
    return _beside(residual[rows].mean(axis=1), columns[rows].mean(axis=1)), other


def _cost(own: tuple[Noise, float], parts: Sequence[tuple[Array, NoiseChannel]]) -> float:
    """Minus the log-likelihood of all recordings, the amplitudes of the columns integrated out."""
    noise, spread = own
    k = parts[0][0].shape[1] - 1
    total, gram = 0.0, np.zeros((k + 1, k + 1))
    for both, run in parts:
        covariance = noise.covariance(run)
        gram += covariance.gram(both)
        total += 0.5 * covariance.log_det
    factor = cho_factor(np.eye(k) + spread**2 * gram[1:, 1:], lower=True)
    score = spread * gram[1:, 0]
    explained = float(score @ cho_solve(factor, score))
    return total + 0.5 * (float(gram[0, 0]) - explained) + float(np.sum(np.log(np.diag(factor[0]))))
