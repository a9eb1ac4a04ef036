"""Covariance of a channel's residual: independent noise, processes that remember, and noise of a second derivative.

    K = diag(variance) + sum_s level_s² c_s(|t - t'| / time_s) + diag(b) T diag(b)

with c(x) = e^(-x) of a first-order lag, (1 + x) e^(-x) of two in a row (Matérn 3/2; Rasmussen and Williams 2006,
chapter 4), an oscillation that decays with e^(-x) of a vibration, and T the covariance of (e_t - 2 e_t-1 + e_t-2) / √6.

Every remembering process is an autoregression of first or second order on the band's even clock, so that with the
hidden values x (all processes and e, sample by sample) K = D + H Q⁻¹ H' with a banded precision Q (Särkkä and Solin
2019, chapter 12). By Woodbury's identity K⁻¹ and log det K then cost O(n), not O(n³). So do products x' K⁻¹ y and
log det K by the innovations of a Kalman filter, which are quicker where they can be compiled (`innovations`).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs

from ..fitting.periodogram import pair_products
from .innovations import HiddenNoise, compiles

Array = NDArray[np.float64]

ROOT6 = np.sqrt(6.0)

_FACTORISE, _DIVIDE, _DIVIDE_BY_ROOT = get_lapack_funcs(("pbtrf", "pbtrs", "tbtrs"), dtype=np.float64)
"""LAPACK without scipy's checks, which take as long: a diagnosis calls them thousands of times."""


@dataclass(frozen=True)
class LaggedNoise:
    """White noise through a lag, or through two in a row (``order`` 2; its spectrum falls with f⁴): standard deviation
    ``level``, one number or one a sample (n,), and the lag's ``time`` [s]. Of order 2 it may vibrate at a ``frequency``
    [Hz], as an oscillator does that is shaken, and whose vibration decays within ``time``."""

    level: "float | Array"
    time: float
    order: int = 1
    frequency: float = 0.0


class Covariance:
    """K of one channel of one recording, ready to be divided by.

    Parameters
    ----------
    variance : array (n,)
        Of what is independent from sample to sample; positive.
    processes : sequence of LaggedNoise
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
        processes: Sequence[LaggedNoise],
        derivative: Array | None,
        step: float,
        segments: Sequence[slice],
    ) -> None:
        """Nothing is worked out yet."""
        self._variance = np.ascontiguousarray(variance, float)
        n = len(self._variance)
        there = [p for p in processes if np.any(np.asarray(p.level) > 0)]
        self._levels = [np.broadcast_to(np.asarray(p.level, float), (n,)) for p in there]
        has = derivative is not None and bool(np.any(derivative > 0))
        self._width = (len(self._levels) + has) * bool(n)
        self._orders = [p.order for p in there]
        self._recursions = [_recursion(p, step) for p in there]
        self._derivative = self._lagged(np.asarray(derivative, float), segments) if has else None
        self._first, self._second = np.zeros((2, n), bool)
        if not self._width:
            return
        self._first[[s.start for s in segments if s.stop > s.start]] = True
        self._second[[s.start + 1 for s in segments if s.stop > s.start + 1]] = True

    @staticmethod
    def _lagged(b: Array, segments: Sequence[slice]) -> tuple[Array, Array, Array]:
        """Weights of e_t, e_t-1 and e_t-2 in sample t; no sample reaches back across a gap."""
        one, two = np.zeros_like(b), np.zeros_like(b)
        for s in segments:
            one[s.start + 1 : s.stop] = b[s.start + 1 : s.stop]
            two[s.start + 2 : s.stop] = b[s.start + 2 : s.stop]
        return b / ROOT6, -2 * one / ROOT6, two / ROOT6

    @cached_property
    def _band(self) -> tuple[Array, float]:
        """Cholesky factor of the hidden values' precision Q + H' D⁻¹ H, and log det K."""
        n, width, has = len(self._variance), self._width, self._derivative is not None
        first, second = self._first, self._second
        log_det = float(np.sum(np.log(self._variance)))
        band = np.zeros(((2 * width if has or 2 in self._orders else width) + 1, n * width))
        for s, ((a, b, fresh), order) in enumerate(zip(self._recursions, self._orders, strict=True)):
            one, two = np.full(n, a), np.full(n, b)  # from the sample before, and from the one before that
            news = np.full(n, 1 / fresh)
            begins = a / (1 - b)
            one[second], two[second], news[second] = begins, 0.0, 1 / (1 - begins**2)
            one[first], two[first], news[first] = 0.0, 0.0, 1.0
            band[0, s::width] += news
            band[0, s::width][:-1] += (one**2 * news)[1:]
            band[width, s::width][:-1] -= (one * news)[1:]
            if order == 2:
                band[0, s::width][:-2] += (two**2 * news)[2:]
                band[width, s::width][:-2] += (one * two * news)[2:]
                band[2 * width, s::width][:-2] -= (two * news)[2:]
            log_det -= float(np.sum(np.log(news)))
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
                band[lag, skip * width + start :: width][: n - skip] += product[skip:]
        factor, failed = _FACTORISE(band, lower=1)
        if failed:
            raise np.linalg.LinAlgError(f"{failed}-th leading minor not positive definite")
        return factor, log_det + 2 * float(np.sum(np.log(factor[0])))

    def _rows(self) -> list[tuple[int, Array]]:
        """H: offsets from t * width of the hidden values in sample t, and their weights (n,)."""
        width = self._width
        rows: list[tuple[int, Array]] = list(enumerate(self._levels))
        if self._derivative is not None:
            rows += [(width - 1 - k * width, weight) for k, weight in enumerate(self._derivative)]
        return rows

    @property
    def variance(self) -> Array:
        """Variance of the part that is independent from sample to sample (n,)."""
        return self._variance

    @property
    def log_det(self) -> float:
        """Log determinant of K."""
        if not self._width:
            return float(np.sum(np.log(self._variance)))
        return 2 * float(np.sum(np.log(self._gains[1]))) if compiles() else self._band[1]

    def solve(self, x: Array) -> Array:
        """K⁻¹ x for columns x (n, k), or one (n,)."""
        flat = x.reshape(len(x), -1)
        z = flat / self._variance[:, None]
        if self._width and flat.size:
            n, width = len(flat), self._width
            hidden, _ = _DIVIDE(self._band[0], self._on_hidden(z), lower=1, overwrite_b=1)
            back = np.zeros_like(flat)
            for offset, weight in self._rows():
                skip = -(offset // width) if offset < 0 else 0
                back[skip:] += weight[skip:, None] * hidden[skip * width + offset :: width][: n - skip]
            z -= back / self._variance[:, None]
        return z.reshape(x.shape)

    def _on_hidden(self, z: Array) -> Array:
        """H' z for columns z (n, k)."""
        n, width = len(z), self._width
        hidden = np.zeros((n * width, z.shape[1]), order="F")
        for offset, weight in self._rows():
            skip = -(offset // width) if offset < 0 else 0
            hidden[skip * width + offset :: width][: n - skip] += weight[skip:, None] * z[skip:]
        return hidden

    def gram(self, x: Array) -> Array:
        """x' K⁻¹ x (k, k) of columns x (n, k), at half the cost of `solve`."""
        if compiles():
            white = self.white(x)
            return white.T @ white
        z = x / self._variance[:, None]
        found = x.T @ z
        if self._width and x.size:
            half, _ = _DIVIDE_BY_ROOT(self._band[0], self._on_hidden(z), uplo="L", overwrite_b=1)
            found -= half.T @ half
        return found

    def pair_grams(self, x: Array, y: Array) -> Array:
        """Of every pair of columns (x_k, y_k), both (n, k): products with K⁻¹ between the two (k, 2, 2), as `gram` has
        them, without those between pairs."""
        white = np.hsplit(self.white(np.concatenate([x, y], axis=1)), 2)
        return pair_products(white, white)

    def white(self, x: Array) -> Array:
        """Columns x (n, k) made white, so that white(x)' white(y) = x' K⁻¹ y: `solve` at half its cost for many.

        A white sample is an innovation of a Kalman filter in units of its deviation: the part that the samples before
        it do not predict (Durbin and Koopman 2012, chapter 4). All columns go through one pass.
        """
        return np.concatenate(list(self.white_by_rows([x])))

    def white_by_rows(self, parts: Iterable[Array]) -> Iterator[Array]:
        """`white` of columns that come some rows at a time (n_i, k): all of them at once may not fit in memory."""
        state, row = None, 0
        for x in parts:
            rows = slice(row, row + len(x))
            if not self._width:
                yield x / np.sqrt(self._variance[rows, None])
            else:
                if state is None:
                    state = np.zeros((self._hidden.weights.shape[1], x.shape[1]))
                yield self._hidden.innovations(x, rows, state, *self._gains)
            row = rows.stop

    def log_density(self, x: Array) -> Array:
        """Log density of each sample of x (n,), given those before it [nats] (n,)."""
        deviation = self._gains[1] if self._width else np.sqrt(self._variance)
        return -0.5 * self.white(x[:, None])[:, 0] ** 2 - np.log(deviation) - 0.5 * np.log(2 * np.pi)

    @cached_property
    def _hidden(self) -> HiddenNoise:
        """Values of every process, those before of what has two lags, and e with the two before it."""
        n, s = len(self._variance), len(self._levels)
        smooth = [k for k, order in enumerate(self._orders) if order == 2]
        before = [np.zeros(n)] * len(smooth)
        weights = np.stack([*self._levels, *before, *(self._derivative or ())], axis=1)
        d = weights.shape[1]
        forward, start, news = np.zeros((d, d)), np.eye(d), np.zeros((d, d))
        for k, ((a, b, fresh), order) in enumerate(zip(self._recursions, self._orders, strict=True)):
            news[k, k] = fresh
            forward[k, k] = a
            if order == 2:
                then = s + smooth.index(k)
                forward[k, then], forward[then, k] = b, 1.0
                start[k, then] = start[then, k] = a / (1 - b)
        s += len(smooth)
        if d > s:  # e_t is new; the two before it move on
            forward[s + 1, s] = forward[s + 2, s + 1] = news[s, s] = 1.0
            start[s + 1 :, s + 1 :] = 0.0
        return HiddenNoise(weights, self._variance, self._first, forward, start, news)

    @cached_property
    def _gains(self) -> tuple[Array, Array]:
        return self._hidden.gains()

    def dense(self) -> Array:
        """K itself (n, n); for tests."""
        n = len(self._variance)
        return np.asarray(np.linalg.inv(self.solve(np.eye(n))), float)


def _recursion(process: LaggedNoise, step: float) -> tuple[float, float, float]:
    """Of a process of unit variance: its factors of the sample before and of the one before that, and the variance of
    what is new (Box and Jenkins 1976, chapter 3)."""
    decay = float(np.exp(-step / process.time))
    if process.order == 1:
        return decay, 0.0, 1 - decay**2
    a, b = 2 * decay * float(np.cos(2 * np.pi * process.frequency * step)), -(decay**2)
    return a, b, (1 + b) * ((1 - b) ** 2 - a**2) / (1 - b)
