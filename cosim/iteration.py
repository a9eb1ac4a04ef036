"""Interface quasi-Newton iteration: solve y = S(y) where each evaluation of S is expensive.

For an implicit macro step, y is what the outputs are assumed to be at the end of the step and S(y) what they turn out
to be; every evaluation puts the participants back to the start of the step. From the pairs seen so far, differences of
results W and of residuals V give the next assumption by least squares:

    r = S(y) - y,    c = argmin |r + V c|,    y_next = S(y) + W c

(Degroote, Bathe & Vierendeels 2009, Performance of a new partitioned procedure versus a monolithic procedure in
fluid-structure interaction, Computers and Structures 87; the same as Anderson's method without damping.) A linear
interface of n values is solved in n + 1 evaluations at most; differences kept from earlier steps save most of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError

_CUTOFF = 1e-9  # directions of smaller relative size are noise


@dataclass(frozen=True)
class Iteration:
    """Tolerance and limit of an implicit step's iteration.

    Parameters
    ----------
    tolerance : float
        Largest residual of a connected output, relative to the largest magnitude that the output has had.
    limit : int
        Most evaluations in a step.
    kept : int
        Most differences kept from one step to the next.
    """

    tolerance: float = 1e-9
    limit: int = 30
    kept: int = 8

    def __post_init__(self) -> None:
        """Refuse what could never end."""
        if not self.tolerance > 0 or self.limit < 2:
            raise InputError(
                f"iteration: tolerance {self.tolerance} must be positive and limit {self.limit} at least 2"
            )


class ConvergenceError(RuntimeError):
    """The iteration ended with a residual above its tolerance."""


class QuasiNewton:
    """The solver with its memory of differences.

    Parameters
    ----------
    iteration : Iteration
    """

    def __init__(self, iteration: Iteration) -> None:
        """Start without memory."""
        self.iteration = iteration
        self._residuals: list[np.ndarray] = []
        self._results: list[np.ndarray] = []

    def forget(self) -> None:
        """Drop the differences, where the step size or the system's state has jumped."""
        self._residuals.clear()
        self._results.clear()

    def solve(
        self, function: Callable[[np.ndarray], np.ndarray], guess: np.ndarray, scale: np.ndarray
    ) -> tuple[np.ndarray, int]:
        """Fixed point of a function, from a guess (n,).

        Parameters
        ----------
        function : callable
            S, from and to shape (n,).
        guess : array (n,)
        scale : array (n,)
            Magnitudes by which residuals are measured, positive.

        Returns
        -------
        tuple
            S at the last assumption, and the number of evaluations.

        Raises
        ------
        NotConverged
            After ``iteration.limit`` evaluations.
        """
        before: tuple[np.ndarray, np.ndarray] | None = None
        worst = np.inf
        for count in range(1, self.iteration.limit + 1):
            result = function(guess)
            residual = (result - guess) / scale
            worst = float(np.max(np.abs(residual), initial=0.0))
            if worst <= self.iteration.tolerance:
                return result, count
            if not np.isfinite(worst):
                break
            if before is not None:
                self._residuals.insert(0, residual - before[0])
                self._results.insert(0, result - before[1])
                del self._residuals[self.iteration.kept :], self._results[self.iteration.kept :]
            before = residual, result
            guess = result + self._correction(residual)
        self.forget()
        raise ConvergenceError(f"residual {worst:.1e} of the values' magnitude after {count} evaluations")

    def _correction(self, residual: np.ndarray) -> np.ndarray | float:
        if not self._residuals:
            return 0.0
        differences = np.array(self._residuals)
        lengths = np.sqrt(np.einsum("ij,ij->i", differences, differences))
        lengths[lengths == 0] = 1.0
        shares = np.linalg.lstsq((differences / lengths[:, None]).T, -residual, rcond=_CUTOFF)[0] / lengths
        return shares @ np.array(self._results)
