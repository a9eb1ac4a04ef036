"""Covariance of a channel's residual: independent noise, processes that remember, and noise of a second derivative.

    K = diag(variance) + sum_s level_s² exp(-|t - t'| / time_s) + diag(b) T diag(b)

with T the covariance of (e_t - 2 e_t-1 + e_t-2) / √6.

Every remembering process is an autoregression of first order on the band's even clock, so that with the hidden values
x (all processes and e, sample by sample) K = D + H Q⁻¹ H' with a banded precision Q (Särkkä and Solin 2019, chapter
12). By Woodbury's identity K⁻¹ and log det K then cost O(n), not O(n³).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve_banded, cholesky_banded

Array = NDArray[np.float64]

ROOT6 = np.sqrt(6.0)

MANY = 150
"""Columns from which on they are divided side by side."""


@dataclass(frozen=True)
class Remembering:
    """A process of first order: standard deviation ``level``, one number or one a sample (n,), and correlation
    ``time`` [s]."""

    level: "float | Array"
    time: float


class Covariance:
    """K of one channel of one recording, ready to be divided by.

    Parameters
    ----------
    variance : array (n,)
        Of what is independent from sample to sample; positive.
    processes : sequence of Remembering
    derivative : array (n,) or None
        Standard deviation b of noise that is a second difference; None or zeros: there is none.
    step : float
        Sample period in the analysis band [s].
    segments : sequence of slice
        Runs without a gap; nothing is remembered across one.
    """

    def __init__(
        self,
        variance: Array,
        processes: Sequence[Remembering],
        derivative: Array | None,
        step: float,
        segments: Sequence[slice],
    ) -> None:
        """Factorise."""
        self._variance = np.asarray(variance, float)
        n = len(self._variance)
        there = [p for p in processes if np.any(np.asarray(p.level) > 0)]
        self._levels = [np.broadcast_to(np.asarray(p.level, float), (n,)) for p in there]
        times = [p.time for p in there]
        has = derivative is not None and bool(np.any(derivative > 0))
        self._width = width = len(self._levels) + has
        self._log_det = float(np.sum(np.log(self._variance)))
        self._derivative = self._lagged(np.asarray(derivative, float), segments) if has else None
        if not width:
            return
        first = np.zeros(n, bool)
        first[[s.start for s in segments if s.stop > s.start]] = True
        band = np.zeros(((2 * width if has else width) + 1, n * width))
        for s, time in enumerate(times):
            decay = np.where(first, 0.0, np.exp(-step / time))  # from the sample before
            news = 1 / (1 - decay**2)
            band[0, s::width] += news
            band[0, s::width][:-1] += (decay**2 * news)[1:]
            band[width, s::width][:-1] -= (decay * news)[1:]
            self._log_det -= float(np.sum(np.log(news)))
        if has:
            band[0, width - 1 :: width] += 1.0
        rows = self._rows()
        for one, left in rows:
            for other, right in rows:
                if one < other:
                    continue
                product = left * right / self._variance
                lag, start = one - other, other
                # Sample t's entry stands in column t * width + start; those before the first sample are zero.
                skip = -(start // width) if start < 0 else 0
                at = np.arange(skip, n) * width + start
                band[lag, at] += product[skip:]
        factor = cholesky_banded(band, lower=True, check_finite=False)
        self._log_det += 2 * float(np.sum(np.log(factor[0])))
        self._factor = factor

    @staticmethod
    def _lagged(b: Array, segments: Sequence[slice]) -> tuple[Array, Array, Array]:
        """Weights of e_t, e_t-1 and e_t-2 in sample t; no sample reaches back across a gap."""
        one, two = np.zeros_like(b), np.zeros_like(b)
        for s in segments:
            one[s.start + 1 : s.stop] = b[s.start + 1 : s.stop]
            two[s.start + 2 : s.stop] = b[s.start + 2 : s.stop]
        return b / ROOT6, -2 * one / ROOT6, two / ROOT6

    def _rows(self) -> list[tuple[int, Array]]:
        """H: offsets from t * width of the hidden values in sample t, and their weights (n,)."""
        width = self._width
        rows: list[tuple[int, Array]] = list(enumerate(self._levels))
        if self._derivative is not None:
            rows += [(width - 1 - k * width, weight) for k, weight in enumerate(self._derivative)]
        return rows

    @property
    def log_det(self) -> float:
        """Log determinant of K."""
        return self._log_det

    def solve(self, x: Array) -> Array:
        """K⁻¹ x for columns x (n, k), or one (n,)."""
        flat = x.reshape(len(x), -1)
        z = flat / self._variance[:, None]
        if self._width:
            n, width = len(flat), self._width
            hidden = np.zeros((n * width, flat.shape[1]))
            rows = self._rows()
            for offset, weight in rows:
                skip = -(offset // width) if offset < 0 else 0
                hidden[skip * width + offset :: width][: n - skip] += weight[skip:, None] * z[skip:]
            if flat.shape[1] < MANY:
                hidden = cho_solve_banded((self._factor, True), hidden, overwrite_b=True, check_finite=False)
            else:
                hidden = _substituted(self._factor, hidden)
            back = np.zeros_like(flat)
            for offset, weight in rows:
                skip = -(offset // width) if offset < 0 else 0
                back[skip:] += weight[skip:, None] * hidden[skip * width + offset :: width][: n - skip]
            z -= back / self._variance[:, None]
        return z.reshape(x.shape)

    def dense(self) -> Array:
        """K itself (n, n); for tests."""
        n = len(self._variance)
        return np.asarray(np.linalg.inv(self.solve(np.eye(n))), float)


def _substituted(factor: Array, right: Array) -> Array:
    """L⁻ᵀ L⁻¹ of many columns side by side: LAPACK takes banded systems column by column, three times as slowly."""
    width, n = len(factor) - 1, len(right)
    padded = np.zeros((n + 2 * width, right.shape[1]))
    inner = padded[width : width + n]
    before, after = np.zeros((n, width)), np.zeros((n, width))
    for d in range(1, width + 1):
        before[d:, width - d] = factor[d, : n - d]
        after[: n - d, d - 1] = factor[d, : n - d]
    scale = 1 / factor[0]
    before, after = before * scale[:, None], after * scale[:, None]
    np.multiply(right, scale[:, None], out=inner)
    for i in range(n):
        inner[i] -= before[i] @ padded[i : i + width]
    inner *= scale[:, None]
    for i in range(n - 1, -1, -1):
        inner[i] -= after[i] @ padded[i + width + 1 : i + 2 * width + 1]
    return inner
