"""Recordings under a fit, ready to be searched."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..nuisance.noise import Noise, NoiseChannel
from .evidence import Evidence
from .pool import Hypothesis

Array = NDArray[np.float64]
Part = tuple[NDArray[np.int_], Array]
"""Positions (p,) among all that stands beside, and columns (n, p) in units of their prior deviation."""


@dataclass(frozen=True)
class NuisanceColumns:
    """``parts[i][c]`` are those of recording i and channel c; ``tolerant`` is the position of the masses' tolerance in
    them.
    """

    parts: list[list[Part]]
    count: int
    tolerant: slice
    noise_beside: list[list[Array]]
    """Columns (n, k) of recording i and channel c beside which the noise is learnt, of any size."""
    spread: Array
    """Prior deviation of each of the baseline's parameters about its fit (P,), the first columns' unit."""
    more: tuple[float, ...] = ()
    """Tolerances beyond `TOLERANCES` that may be chosen."""

    def weight(self, tolerance: float) -> Array:
        """Factors on the prior deviations (count,) for masses that are known to a share."""
        weight = np.ones(self.count)
        weight[self.tolerant] = tolerance
        return weight


@dataclass(frozen=True)
class WeighedRecordings:
    """Recordings under a fit, ready to be searched: the training recordings come first."""

    evidence: Evidence
    pool: tuple[Hypothesis, ...]
    noises: tuple[Noise, ...]
    beside: NuisanceColumns
    scale: Array
    n_train: int
    runs: list[list[NoiseChannel]]
    bare: Callable[[int], Noise]
    """A channel's noise where nothing is missing."""
    noise_of_rest: Callable[[int, Sequence[Array]], Noise]
    """A channel's noise where nothing is missing but these parts (n,) of the training recordings' residuals."""

    def in_noise(self, c: int, noise: Noise) -> "WeighedRecordings":
        """These recordings with another noise of one channel."""
        alone, _, _ = self.evidence.alone(c, ())
        own = [noise.covariance(row[c]) for row in self.runs]
        return self.with_noise(c, noise, alone.with_covariances(0, own))

    def with_noise(self, c: int, noise: Noise, alone: Evidence) -> "WeighedRecordings":
        """These recordings with another noise of one channel; ``alone`` is the channel's evidence under that noise."""
        noises = tuple(noise if k == c else x for k, x in enumerate(self.noises))
        return replace(self, evidence=self.evidence.with_channel(c, alone), noises=noises)


def principal(parts: Sequence[Array], most: int) -> list[Array]:
    """Principal directions of columns that are scaled to unit RMS; the directions have unit RMS too."""
    whole = np.concatenate(list(parts))
    size = np.sqrt(np.mean(whole**2, axis=0))
    use = size > 1e-9 * size.max(initial=1e-300)
    u, d, _ = np.linalg.svd(whole[:, use] / size[use], full_matrices=False)
    kept = u[:, (np.arange(len(d)) < most) & (d > 1e-3 * d.max(initial=0.0))] * np.sqrt(len(u))
    return np.split(kept, np.cumsum([len(p) for p in parts])[:-1])
