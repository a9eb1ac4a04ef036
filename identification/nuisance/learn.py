"""Scales of a channel's noise: those of highest marginal likelihood beside everything that could explain the residual.

Beside the baseline alone the noise would learn the missing physics, and then hide it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..deciding import ODDS_OF_CURVES
from .coloured import fast_scales
from .noise import Noise, NoiseChannel
from .wander import level_and_time

Array = NDArray[np.float64]


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
        How many share the prior odds that something wanders, or is smooth, which are those of nameless physics.
    """
    odds = ODDS_OF_CURVES / channels
    size = float(np.std(np.concatenate(list(residuals)))) + 1e-12
    found = fast_scales(residuals, columns, runs, freely, odds)
    wander, time = level_and_time(residuals, columns, runs, found, freely, odds)
    return replace(found, wander=wander, wander_time=time, unit=size, odds=odds)
