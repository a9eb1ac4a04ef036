"""Noise of every channel, learnt once from the saturated model, and the time blocks that count as independent."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fitting.experiment import Experiment
from .noise import Whitener, whitener
from .rest import Without, near_rest, without

Array = NDArray[np.float64]

BLOCK = 1.5
"""[s] Shortest time block: longer than the residual remembers."""

MOST_BLOCKS = 24


@dataclass(frozen=True)
class Noise:
    """Whitener and innovations of every channel, learnt once from the saturated model, and the time blocks.

    Samples near rest of a channel's joint are left out of all but `whiten_all` and ``times``.
    """

    whiteners: tuple[Whitener, ...]
    moving: tuple[Without, ...]
    innovations: tuple[Array, ...]
    times: NDArray[np.int_]
    """Time block of every innovation."""
    n_blocks: int
    segments: tuple[tuple[slice, ...], ...]

    def whiten(self, channel: int, parts: Sequence[Array]) -> Array:
        """Columns of one channel, all experiments, as innovations in motion (n_white, k)."""
        return self.moving[channel](self.whiten_all(channel, parts))

    def whiten_all(self, channel: int, parts: Sequence[Array]) -> Array:
        """The same with the samples near rest (n_all, k)."""
        own = self.whiteners[channel]
        return np.concatenate([own(x, s) for x, s in zip(parts, self.segments, strict=True)])

    def blocks(self, channel: int) -> NDArray[np.int_]:
        """Time block of every innovation in motion (n_white,)."""
        return self.moving[channel].first(self.times)


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
    rest = [[near_rest(e, c) for e in experiments] for c in range(len(columns))]
    learnt = [whitener(whole[:, c], own, joined, np.concatenate(rest[c])) for c, own in enumerate(columns)]
    lead = learnt[0][0].lead
    blocks, count = [], 0
    for e, parts in zip(experiments, segments, strict=True):
        n = sum(max(0, s.stop - s.start - lead) for s in parts)
        pieces = int(np.clip(n / (2 * e.motion.band) / BLOCK, 2, max(4, MOST_BLOCKS // len(experiments))))
        blocks.append(count + np.minimum(np.arange(n) * pieces // max(n, 1), pieces - 1))
        count += pieces
    whiteners, innovations = zip(*learnt, strict=True)
    moving = tuple(without(m, segments, w.coefficients, lead) for m, w in zip(rest, whiteners, strict=True))
    return Noise(
        whiteners,
        moving,
        tuple(pick(x) for pick, x in zip(moving, innovations, strict=True)),
        np.concatenate(blocks),
        count,
        segments,
    )
