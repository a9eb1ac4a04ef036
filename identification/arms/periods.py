"""Lengths of waves to try at each place, from the periodogram of what a fit leaves there."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from ...models.model import PlacedEffect
from ..evidence.projected import ROUNDING
from ..evidence.weighed import NuisanceColumns
from ..fitting.periodogram import Peaks
from ..fitting.wave_lengths import wave_peaks
from ..nuisance.covariance import Covariance
from ..nuisance.noise import Noise, NoiseChannel
from .hypotheses import ColumnSource

Array = NDArray[np.float64]


def rough_noise(residuals: Sequence[Array], runs: Sequence[NoiseChannel]) -> Noise:
    """White and coloured noise of a channel with the autocovariances c of its residual (n,) at lags 0, 1 and 2.

    With decay ρ from sample to sample, level a and white w: c₀ = w² + a², c₁ = a² ρ, c₂ = a² ρ². What is missing is in
    them as well: it makes a periodogram white, and says nothing of how likely anything is.
    """
    sums, counts = np.zeros(3), np.zeros(3)
    for r, run in zip(residuals, runs, strict=True):
        for own in (r[s] for s in run.segments):
            for lag in range(min(3, len(own))):
                sums[lag] += own[lag:] @ own[: len(own) - lag]
                counts[lag] += len(own) - lag
    c = sums / np.maximum(counts, 1)
    decay = float(np.clip(c[2] / c[1], 0.01, 0.99)) if c[1] > 0 else 0.01
    coloured = float(np.clip(c[1] / decay, 0.0, 0.99 * c[0]))
    time = -runs[0].step / float(np.log(decay))
    return Noise(float(np.sqrt(c[0] - coloured)) + 1e-300, float(np.sqrt(coloured)), time, 0.0, 1.0, 0.0)


class Periods:
    """Peaks at every place of an effect with a parameter that is a wave's length, each channel's residual divided once.

    Parameters
    ----------
    along : ColumnSource
    residuals : sequence of array (n, J)
        Of each training recording.
    covariances : sequence of sequence of Covariance
        Of recording i and channel c.
    others : NuisanceColumns
        What is projected out of the residual.
    weight : array (P,)
        Factors on their prior deviations.
    """

    def __init__(
        self,
        along: ColumnSource,
        residuals: Sequence[Array],
        covariances: Sequence[Sequence[Covariance]],
        others: NuisanceColumns,
        weight: Array,
    ) -> None:
        """Nothing is worked out yet."""
        self._along, self._residuals, self._covariances = along, residuals, covariances
        self._others, self._weight = others, weight
        self._divided: dict[int, list[Array]] = {}

    def of(self, placed: Sequence[PlacedEffect]) -> Mapping[str, Peaks]:
        """Peaks by the effect's key, for those that have a parameter which is a wave's length, and a motion."""
        found = {}
        for p in placed:
            for x in p.effect.parameters:
                if not x.periodic_over:
                    continue
                own = self._along
                n = own.n_train
                at = wave_peaks(own.assembly, p, x, own.instruments[:n], own.states[:n], self._weighed, lines=True)
                if at is not None:
                    found[p.key] = at
        return found

    def _weighed(self, i: int, c: int) -> tuple[Array, Callable[[Array, Array], Array]]:
        return self._divided_of(c)[i], self._covariances[i][c].pair_grams

    def _divided_of(self, c: int) -> list[Array]:
        """S⁻¹ r of each recording (n,), S = K + A A' with the columns A that stand beside."""
        if c not in self._divided:
            parts = [row[c] for row in self._others.parts[: len(self._residuals)]]
            own = [row[c] for row in self._covariances]
            index = np.unique(np.concatenate([at for at, _ in parts]))
            matrix, seen, divided = np.eye(len(index)), np.zeros(len(index)), []
            for (at, x), r, k in zip(parts, self._residuals, own, strict=True):
                columns = x * self._weight[at]
                both = k.solve(np.column_stack([r[:, c], columns]))
                where = np.searchsorted(index, at)
                matrix[np.ix_(where, where)] += columns.T @ both[:, 1:]
                seen[where] += columns.T @ both[:, 0]
                divided.append((where, both))
            # Sums of columns that differ by many orders of magnitude are positive definite but for their rounding.
            matrix += ROUNDING * np.trace(matrix) * np.eye(len(index))
            mean = cho_solve(cho_factor(matrix), seen)
            self._divided[c] = [both[:, 0] - both[:, 1:] @ mean[where] for where, both in divided]
        return self._divided[c]
