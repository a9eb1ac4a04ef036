"""The boundary of success from few cases: a Gaussian process of the margin, and the next cases where it is in doubt.

The margin of success (see `study.Success.margin`) over the unit cube of the varied axes is a Gaussian process with a
Matérn-5/2 kernel, one length an axis (Rasmussen & Williams 2006, ch. 4). A point's probability of success is
Phi(mean / deviation). A point is *undecided* where that is between 5 and 95 %; the *width* of the boundary is the
undecided share of the volume. New cases stand where ``1.96 deviation - |mean|`` is largest (the straddle rule: Bryan et
al. 2005), chosen one after another with the deviation updated as if the earlier ones had been run.
"""

import warnings
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from ..extras import needed_for

with needed_for("a study of tolerances"):
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
    from threadpoolctl import ThreadpoolController

UNDECIDED = (0.05, 0.95)
_REFERENCE = 4096


@dataclass(frozen=True)
class Boundary:
    """What a set of cases says of success everywhere in the unit cube.

    Parameters
    ----------
    process : GaussianProcessRegressor
    axes : int
        Dimension of the cube.
    crossed : bool
        Whether successes and failures are both among the cases.
    """

    process: GaussianProcessRegressor
    axes: int
    crossed: bool

    def margin(self, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation of the margin at points of the unit cube, shape (n, n_axes)."""
        with _one_thread():
            mean, deviation = self.process.predict(unit, return_std=True)
        return mean, np.maximum(deviation, 1e-9)

    def probability(self, unit: np.ndarray) -> np.ndarray:
        """Probability of success at points of the unit cube, shape (n,)."""
        mean, deviation = self.margin(unit)
        return norm.cdf(mean / deviation)

    def width(self) -> float:
        """Share of the volume that is undecided, on a fixed reference set; 1 while no case lies across the boundary."""
        if not self.crossed:
            return 1.0
        reference = qmc.Sobol(self.axes, rng=0).random(_REFERENCE)
        p = self.probability(reference)
        return float(np.mean((p > UNDECIDED[0]) & (p < UNDECIDED[1])))

    def next_cases(self, count: int, seed: int, candidates: int = 2048) -> np.ndarray:
        """Points of the unit cube that narrow the boundary most, shape (count, n_axes)."""
        power = 1 << (max(candidates, count) - 1).bit_length()
        points = qmc.Sobol(self.axes, rng=seed).random(power)
        with _one_thread():
            mean, covariance = map(np.asarray, self.process.predict(points, return_cov=True))
        noise = max(float(np.min(np.diag(covariance))), 0.0) * 1e-6 + 1e-9
        chosen: list[int] = []
        for _ in range(count):
            score = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0)) - np.abs(mean)
            score[chosen] = -np.inf
            best = int(np.argmax(score))
            chosen.append(best)
            column = covariance[:, best]
            covariance = covariance - np.outer(column, column) / (column[best] + noise)
        return points[chosen]


def fit_boundary(unit: np.ndarray, margin: np.ndarray, seed: int = 0) -> Boundary:
    """Fit the Gaussian process to cases at points of the unit cube, shape (n, n_axes), with margins, shape (n,).

    Deterministic: the same cases give the same boundary, whatever the number of cores.
    """
    lengths: Any = np.full(unit.shape[1], 0.5)
    kernel = ConstantKernel(0.5, (1e-2, 1e2)) * Matern(lengths, (5e-2, 2e1), nu=2.5) + WhiteKernel(1e-3, (1e-6, 1e-1))
    process = GaussianProcessRegressor(kernel, normalize_y=False, n_restarts_optimizer=1, random_state=seed)
    with _one_thread(), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound: that axis does not matter
        process.fit(unit, margin)
    return Boundary(process, unit.shape[1], bool(np.any(margin > 0) and np.any(margin <= 0)))


def _one_thread() -> AbstractContextManager[Any]:
    """Sums in another order would give another boundary."""
    return _threads().limit(limits=1)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()  # looks for the libraries, which takes milliseconds
