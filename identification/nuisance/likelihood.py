"""The marginal likelihood of a channel's noise, everything that could explain the residual integrated out."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs
from scipy.optimize import minimize

from .noise import Noise, NoiseChannel

Array = NDArray[np.float64]
Part = tuple[Array, NoiseChannel]
"""A residual and what could explain it (n, 1 + k), and the channel of a recording that they are of."""


_FACTORISE, _DIVIDE = get_lapack_funcs(("potrf", "trtrs"), dtype=np.float64)
"""LAPACK without scipy's checks, which take as long: a diagnosis calls them thousands of times."""

SETTLED = 1e-3
"""A search for scales ends where its step gains less [nats]: what is compared with others differs by whole nats."""

REMEMBERED = 8
"""Noises whose products are kept: as many as one finite-difference gradient has."""


def lowest(cost: Callable[[Array], float], start: Array, wide: Array, low: Array, high: Array) -> Array:
    """Where a cost, with a normal prior of its logarithmic scales, is lowest."""

    def whole(x: Array) -> float:
        return cost(x) + 0.5 * float(np.sum(((x - start) / wide) ** 2))

    bounds = list(zip(low, high, strict=True))
    options = {"maxiter": 30, "eps": 1e-3, "ftol": SETTLED / max(abs(whole(start)), 1.0)}
    return minimize(whole, start, method="L-BFGS-B", bounds=bounds, options=options).x


class Cost:
    """Minus the log-likelihood of all recordings under a noise, amplitudes of the columns, which have a common prior
    deviation, integrated out.

    Parameters
    ----------
    parts : sequence of Part
        Of each recording.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        """Nothing is worked out yet."""
        self._parts = parts
        self._products = lru_cache(REMEMBERED)(self._worked_out)

    def __call__(self, noise: Noise, spread: float) -> float:
        """[nats], with ``spread`` the amplitudes' deviation; a noise that was asked last with another is remembered."""
        gram, total = self._products(noise)
        cost = total + 0.5 * float(gram[0, 0])
        if len(gram) == 1:
            return cost
        precision = spread**2 * gram[1:, 1:]
        np.einsum("ii->i", precision)[:] += 1.0
        factor, failed = _FACTORISE(precision, lower=1)
        if failed:
            raise np.linalg.LinAlgError(f"{failed}-th leading minor not positive definite")
        explained, _ = _DIVIDE(factor, spread * gram[1:, 0], lower=1)
        return cost - 0.5 * float(explained @ explained) + float(np.sum(np.log(np.diag(factor))))

    def _worked_out(self, noise: Noise) -> tuple[Array, float]:
        """Products of residual and columns (1 + k, 1 + k), and half of the log determinant, over all recordings."""
        k = self._parts[0][0].shape[1]
        total, gram = 0.0, np.zeros((k, k))
        for both, run in self._parts:
            covariance = noise.covariance(run)
            gram += covariance.gram(both)
            total += 0.5 * covariance.log_det
        return gram, total
