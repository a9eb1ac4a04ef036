"""Noise of every channel, learnt once from the saturated model, and the time blocks that count as independent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .experiment import Experiment
from .noise import Whitener, whitener

Array = NDArray[np.float64]

BLOCK = 1.5
"""[s] Shortest time block: longer than the residual remembers."""

MOST_BLOCKS = 24


@dataclass(frozen=True)
class Noise:
    """Whitener and innovations of every channel, learnt once from the saturated model, and the time blocks."""

    whiteners: tuple[Whitener, ...]
    innovations: tuple[Array, ...]
    blocks: NDArray[np.int_]
    segments: tuple[tuple[slice, ...], ...]

    def whiten(self, channel: int, parts: Sequence[Array]) -> Array:
        """Columns of one channel, all experiments, as innovations (n_white, k)."""
        own = self.whiteners[channel]
        return np.concatenate([own(x, s) for x, s in zip(parts, self.segments, strict=True)])

    def whiten_mask(self, channel: int, parts: Sequence[NDArray[np.bool_]]) -> NDArray[np.bool_]:
        """Innovations that a marked sample reaches (n_white,)."""
        own = self.whiteners[channel]
        reach = len(own.coefficients) + 1
        spread = [np.convolve(x, np.ones(reach))[: len(x)] > 0 for x in parts]
        return np.concatenate([m[s][own.lead :] for m, p in zip(spread, self.segments, strict=True) for s in p])


def learn(experiments: Sequence[Experiment], residuals: Sequence[Array], columns: Sequence[Array]) -> Noise:
    """Fit a noise model to every channel.

    Parameters
    ----------
    experiments : sequence of Experiment
    residuals : sequence of array (n_band, J)
        Of each recording, under the baseline.
    columns : sequence of array (all n_band, k)
        For each channel, over all recordings: baseline, smooth curves, and one variant of every candidate.
    """
    segments = tuple(e.motion.band_segments() for e in experiments)
    offsets = np.cumsum([0] + [len(r) for r in residuals])
    joined = [slice(s.start + o, s.stop + o) for o, parts in zip(offsets, segments, strict=False) for s in parts]
    whole = np.concatenate(list(residuals))
    learnt = [whitener(whole[:, c], own, joined) for c, own in enumerate(columns)]
    lead = learnt[0][0].lead
    blocks, count = [], 0
    for e, parts in zip(experiments, segments, strict=True):
        n = sum(max(0, s.stop - s.start - lead) for s in parts)
        pieces = int(np.clip(n / (2 * e.motion.band) / BLOCK, 2, max(4, MOST_BLOCKS // len(experiments))))
        blocks.append(count + np.minimum(np.arange(n) * pieces // max(n, 1), pieces - 1))
        count += pieces
    whiteners, innovations = zip(*learnt, strict=True)
    return Noise(whiteners, innovations, np.concatenate(blocks), segments)
