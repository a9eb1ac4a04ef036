"""The marginal likelihood of a channel's noise, everything that could explain the residual integrated out."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from .noise import Noise, NoiseChannel

Array = NDArray[np.float64]
Part = tuple[Array, NoiseChannel]
"""A residual and what could explain it (n, 1 + k), and the channel of a recording that they are of."""


def lowest(cost: Callable[[Array], float], start: Array, wide: Array, low: Array, high: Array) -> Array:
    """Where a cost, with a normal prior of its logarithmic scales, is lowest."""

    def whole(x: Array) -> float:
        return cost(x) + 0.5 * float(np.sum(((x - start) / wide) ** 2))

    bounds = list(zip(low, high, strict=True))
    return minimize(whole, start, method="L-BFGS-B", bounds=bounds, options={"maxiter": 30, "eps": 1e-3}).x


def side_by_side(residual: Array, columns: Array) -> Array:
    """A residual and what could explain it (n, 1 + k), each column's samples side by side."""
    return np.asfortranarray(np.column_stack([residual, columns]))


def cost(own: tuple[Noise, float], parts: Sequence[Part]) -> float:
    """Minus the log-likelihood of all recordings under a noise; amplitudes of the columns, which have a common prior
    deviation, integrated out."""
    noise, spread = own
    k = parts[0][0].shape[1] - 1
    total, gram = 0.0, np.zeros((k + 1, k + 1))
    for both, run in parts:
        covariance = noise.covariance(run)
        gram += covariance.gram(both)
        total += 0.5 * covariance.log_det
    factor = cho_factor(np.eye(k) + spread**2 * gram[1:, 1:], lower=True)
    score = spread * gram[1:, 0]
    explained = float(score @ cho_solve(factor, score))
    return total + 0.5 * (float(gram[0, 0]) - explained) + float(np.sum(np.log(np.diag(factor[0]))))
