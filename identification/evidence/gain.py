"""The standard error of what held-out recordings gain by an explanation, from blocks of time.

With the residual r without the explanation and r - d with it, and the noise covariance K, a block b gains
g_b = (r' K⁻¹ r - (r - d)' K⁻¹ (r - d)) / 2. It is expected to gain e_b = d' K⁻¹ d / 2 if the explanation is true, and
to lose as much if it is not; either way its variance is d' K⁻¹ d = 2 e_b. A law acts where the motion takes it: a block
in which it does little says little, and that such a block gains little is no scatter. So the blocks gain g_b = R e_b,
with one ratio R for all of them, and the variance of their sum is 2 φ E, with E the sum of e_b. The dispersion φ is 1
where the noise is what the model says; it is estimated from the blocks, by moments (McCullagh and Nelder 1989, section
4.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..nuisance.covariance import Covariance

Array = NDArray[np.float64]
Blocks = Callable[[Array], Array]


@dataclass(frozen=True)
class Remaining:
    """What an explanation leaves of a recording: the residual e (n, J) of every channel, and K⁻¹ e (n, J)."""

    residual: Array
    weighed: Array

    @classmethod
    def of(cls, residuals: Sequence[Array], covariances: Sequence[Covariance]) -> "Remaining":
        """Of the residuals (n,) of some channels."""
        solved = [k.solve(e) for e, k in zip(residuals, covariances, strict=True)]
        return cls(np.stack(residuals, 1), np.stack(solved, 1))

    def at(self, samples: Array) -> "Remaining":
        """Of some samples only: a mask (n, 1)."""
        return Remaining(self.residual * samples, self.weighed * samples)

    @property
    def energy(self) -> Array:
        """Each sample's part of e' K⁻¹ e, all channels together (n,)."""
        return np.sum(self.residual * self.weighed, axis=1)


def scatter(without: Sequence[Remaining], with_it: Sequence[Remaining], blocks: Sequence[Blocks]) -> float:
    """Standard error of the log density that recordings gain by an explanation.

    Parameters
    ----------
    without, with_it : sequence of Remaining
        Of each recording.
    blocks : sequence of callable
        Of each recording: sums of an array (n,) over its blocks of time.
    """
    gains, expected = [], []
    for one, other, sums in zip(without, with_it, blocks, strict=True):
        apart = np.sum((one.residual - other.residual) * (one.weighed - other.weighed), axis=1)
        gains.append(0.5 * sums(one.energy - other.energy))
        expected.append(0.5 * sums(apart))
    return standard_error(np.concatenate(gains), np.concatenate(expected))


def standard_error(gains: Array, expected: Array) -> float:
    """Standard error of a sum of gains (n,) of which these were expected (n,).

    By moments: sum (g - R e)² is expected to be 2 φ sum e (1 - e / E). Infinite where one block holds all that was
    expected: nothing tells how another would have gained.
    """
    whole = expected.sum()
    free = expected @ (1 - expected / whole) if whole > 0 else 0.0
    if free <= 0:
        return float("inf")
    ratio = gains.sum() / whole
    dispersion = np.sum((gains - ratio * expected) ** 2) / (2 * free)
    return float(np.sqrt(2 * dispersion * whole))
