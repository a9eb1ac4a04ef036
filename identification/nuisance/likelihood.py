"""The marginal likelihood of a channel's noise, everything that could explain the residual integrated out."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from .noise import Noise, NoiseChannel

Array = NDArray[np.float64]
Part = tuple[Array, NoiseChannel]
"""A residual and what could explain it (n, 1 + k), and the channel of a recording that they are of."""


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


def side_by_side(residual: Array, columns: Array) -> Array:
    """A residual and what could explain it (n, 1 + k), each column's samples side by side."""
    return np.asfortranarray(np.column_stack([residual, columns]))


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
        factor = cho_factor(np.eye(len(gram) - 1) + spread**2 * gram[1:, 1:], lower=True)
        score = spread * gram[1:, 0]
        explained = float(score @ cho_solve(factor, score))
        return total + 0.5 * (float(gram[0, 0]) - explained) + float(np.sum(np.log(np.diag(factor[0]))))

    def _worked_out(self, noise: Noise) -> tuple[Array, float]:
        """Products of residual and columns (1 + k, 1 + k), and half of the log determinant, over all recordings."""
        k = self._parts[0][0].shape[1]
        total, gram = 0.0, np.zeros((k, k))
        for both, run in self._parts:
            covariance = noise.covariance(run)
            gram += covariance.gram(both)
            total += 0.5 * covariance.log_det
        return gram, total
