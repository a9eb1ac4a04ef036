"""White noise and noise of first or second order, beside the settling near rest: what is fast, learnt from a stretch.

    K = w² I + a² e^(-|d|/τ)    or    w² I + a² (1 + |d|/τ) e^(-|d|/τ), approximately

Of sensors, quantisation and cogging a residual remembers milliseconds, and is rough. Structures, and disturbances that
reach a drive through a structure or a servo, leave one without high frequencies: it is smooth. Noise of first order
would take a smooth one for a walk without an end, which wander and physics then share. The likelier order is taken;
what is smooth looks like physics without a name, and has its prior odds.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..deciding import WANDER_TIMES
from .likelihood import Cost, lowest
from .noise import Noise, NoiseChannel

Array = NDArray[np.float64]

ORDERS = (1, 2)
"""Lags in a row."""

STRETCH = 800
"""Samples that the fast scales are learnt from."""


def fast_scales(
    residuals: Sequence[Array], columns: Sequence[Array], runs: Sequence[NoiseChannel], freely: bool, odds: float
) -> Noise:
    """Scales of the fast noise, without a wander; ``odds`` are the prior odds that it is smooth, other arguments as in
    `learn.learn`."""
    whole = np.concatenate(list(residuals))
    size, most = float(np.std(whole)) + 1e-12, float(np.sqrt(np.mean(whole**2))) + 1e-12
    stretch = [slice(0, min(len(r), max(STRETCH // len(runs), 100))) for r in residuals]
    cost = Cost(
        [
            # Whatever is slow there is no matter of the fast scales.
            (np.column_stack([r[rows], c[rows]]), replace(run.some(rows), wanders=1.0))
            for r, c, run, rows in zip(residuals, columns, runs, stretch, strict=True)
        ]
    )

    def fast(x: Array, order: int) -> tuple[Noise, float]:
        white, coloured, time, settling, slow = np.exp(x[:5])
        scales = float(white) + 1e-3 * size, float(coloured), float(time), float(slow), WANDER_TIMES[-1]
        return Noise(*scales, float(settling), order=order), most if freely else float(np.exp(x[5]))

    start = np.log([0.3 * size, 0.3 * size, 0.1, 0.2 * size, size, 0.1 * size])
    wide = np.array([1.5, 1.5, 1.0, 2.0, 2.0, 2.0])
    low, high = start - 6, start + np.array([2.0, 2.0, 1.6, 3.0, 2.0, 3.0])
    own = slice(0, 5 if freely else 6)
    tried = []
    for order, prior in zip(ORDERS, (1.0, odds), strict=True):
        # What is smooth may be faster, as two lags take more away, and slower, as it is no wander.
        low[2], high[2] = np.log(0.02 / order), np.log(0.5 * order)
        x = lowest(lambda x, order=order: cost(*fast(x, order)), start[own], wide[own], low[own], high[own])
        tried.append((cost(*fast(x, order)) - float(np.log(prior)), order, fast(x, order)[0]))
    return min(tried, key=lambda t: t[:2])[2]
