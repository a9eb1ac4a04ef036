"""The least of a convex quadratic form above lower bounds."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Array = NDArray[np.float64]

TRIED = 3
"""Exchanges of all that is wrong which may bring no progress, before one number at a time is exchanged."""


def least_above(matrix: Array, right: Array, low: Array, held: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
    """b (P,) that minimises ½ b' M b - r' b with b >= low, and which of it stands at its bound.

    Block principal pivoting (Júdice and Pires 1994; Kim and Park 2011): what is free and below its bound is held there,
    what is held and pulls upward is let go, all at once; where that goes in circles, the last such number alone, which
    ends (Murty 1974).

    Parameters
    ----------
    matrix : array (P, P)
        M, positive definite.
    right, low : array (P,)
        r, and the lower bounds; -inf where there is none.
    held : array of bool (P,)
        A first guess of what stands at its bound.
    """
    held = held & np.isfinite(low)
    fewest, left = len(low) + 1, TRIED
    while True:
        b = np.where(held, low, 0.0)
        free = np.flatnonzero(~held)
        beside = right[free] - matrix[np.ix_(free, held)] @ low[held]
        b[free] = cho_solve(cho_factor(matrix[np.ix_(free, free)], lower=True), beside)
        pull = right - matrix @ b
        # What lies at its bound, or is pulled by nothing, to the rounding of the sums that it comes of is not wrong.
        small = 1e-12 * (np.abs(right) + np.abs(matrix) @ np.abs(b))
        wrong = np.flatnonzero(np.where(held, pull > small, b < low - 1e-12 * np.abs(low)))
        if not len(wrong):
            return np.maximum(b, low), held
        if len(wrong) < fewest:
            fewest, left = len(wrong), TRIED
        elif left:
            left -= 1
        else:
            wrong = wrong[-1:]
        held = held.copy()
        held[wrong] = ~held[wrong]
