"""A periodogram by least squares: what a wave of each trial length would explain of a residual that samples a signal.

At w waves per unit of the signal s, with columns C = (cos 2πws, sin 2πws) as the channel sees them, residual r and its
covariance K, the power is P(w) = r'K⁻¹C (C'K⁻¹C)⁻¹ C'K⁻¹r: twice the log-likelihood that cosine and sine gain. For
white noise it is the periodogram of Lomb (1976) and Scargle (1982).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PER_ELEMENT = 3
"""Trial lengths in a resolution element, one wave more in the travel: the next one is a sixth of it away at most."""

MOST_PEAKS = 8
"""Peaks that are tried: what else is missing may make some of them."""

TOGETHER = 32
"""Trial lengths worked out at a time."""


@dataclass(frozen=True)
class SampledSignal:
    """One channel of one recording: the signal (n,), and how columns (n, k) of it are seen (n_seen, k); K⁻¹ r (n_seen,)
    and the map of cosines and sines, both (n_seen, k), to C'K⁻¹C of each pair C (k, 2, 2)."""

    signal: Array
    seen: Callable[[Array], Array]
    divided: Array
    grams: Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Peaks:
    """The highest peaks of a periodogram: waves per unit of the signal (k,), in order, between trials that stand
    ``step`` apart; ``trials`` is how many there were, ``best`` the position of the highest."""

    waves: Array
    step: float
    trials: int
    best: int = 0


def pair_products(left: Sequence[Array], right: Sequence[Array]) -> Array:
    """Products x_k' y_k (k, 2, 2) between the two of ``left`` and the two of ``right``, each (n, k)."""
    return np.stack([[np.einsum("nk,nk->k", x, y) for y in right] for x in left]).transpose(2, 0, 1)


def trial_waves(signals: Sequence[Array], shortest: float, longest: float) -> Array:
    """Trial numbers of waves per unit of a signal (N,), evenly spaced; empty where it does not move.

    Half of the signal's steps are shorter than half of the shortest wave. ``signals``: at the rate at which they are
    seen. ``shortest`` and ``longest``: bounds of a wave's length.
    """
    travel = max(float(np.max(x)) for x in signals) - min(float(np.min(x)) for x in signals)
    steps = np.abs(np.concatenate([np.diff(x) for x in signals]))
    moving = steps[steps > 1e-6 * travel]
    if not len(moving):
        return np.zeros(0)
    low, high = 1 / longest, min(1 / shortest, 1 / (2 * float(np.median(moving))))
    return np.arange(low, high, 1 / (PER_ELEMENT * travel))


def periodogram(waves: Array, runs: Sequence[SampledSignal]) -> Array:
    """Power (N,) at evenly spaced numbers of waves (N,); 0 where cosine and sine cannot be told apart."""
    score, matrix = np.zeros((len(waves), 2)), np.zeros((len(waves), 2, 2))
    step = waves[1] - waves[0] if len(waves) > 1 else 0.0
    for run in runs:
        on = np.exp(2j * np.pi * step * run.signal[:, None] * np.arange(min(TOGETHER, len(waves))))
        for start in range(0, len(waves), TOGETHER):
            own = slice(start, min(start + TOGETHER, len(waves)))
            n = own.stop - start
            turned = on[:, :n] * np.exp(2j * np.pi * waves[start] * run.signal[:, None])
            columns = np.asfortranarray(run.seen(np.concatenate([turned.real, turned.imag], axis=1)))
            score[own] += (run.divided @ columns).reshape(2, n).T
            matrix[own] += run.grams(columns[:, :n], columns[:, n:])
    trace = np.trace(matrix, axis1=1, axis2=2)
    apart = np.linalg.det(matrix) > 1e-9 * trace**2
    power = np.zeros(len(waves))
    solved = np.linalg.solve(matrix[apart], score[apart][:, :, None])[:, :, 0]
    power[apart] = np.sum(solved * score[apart], axis=1)
    return power


def peaks(waves: Array, power: Array, *, lines: bool = False) -> Peaks:
    """The highest peaks of a periodogram of one trial or more; with ``lines`` those alone that are none of a continuum.

    A residual may depend on position without repeating. Its power is then exponentially distributed about a continuum,
    of median m: the highest of N trials reaches m ln N / ln 2.
    """
    padded = np.concatenate([[-np.inf], power, [-np.inf]])
    tops = np.flatnonzero((power >= padded[:-2]) & (power > padded[2:]))
    if lines:
        tops = tops[power[tops] > np.median(power) * np.log(len(power)) / np.log(2)]
    tops = np.sort(tops[np.argsort(-power[tops])][:MOST_PEAKS])
    step = float(waves[1] - waves[0]) if len(waves) > 1 else float(waves[0])
    return Peaks(waves[tops], step, len(waves), int(np.argmax(power[tops])) if len(tops) else 0)
