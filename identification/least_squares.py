"""Bounded nonlinear least squares on normal equations: Levenberg–Marquardt with Marquardt's scaling.

One pass over the samples gives cost, gradient and normal matrix; the (n_samples, n_parameters) Jacobian need never
stand in memory at once, which is what makes it quicker than a general solver where samples are many and parameters few
(Levenberg 1944; Marquardt 1963). Bounds are kept by solving each step's quadratic program (Stark & Parker 1995, BVLS).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Normal:
    """Cost ½‖r‖², its gradient Jᵀr (n_parameters,), and the normal matrix JᵀJ (n_parameters, n_parameters)."""

    cost: float
    gradient: Array
    matrix: Array


@dataclass(frozen=True)
class Solution:
    """Where the search ended: parameters, the normal equations there, steps taken, and whether it settled."""

    theta: Array
    normal: Normal
    steps: int
    settled: bool


def minimise(
    normal: Callable[[Array], Normal],
    start: Array,
    low: Array,
    high: Array,
    *,
    max_steps: int = 60,
    tolerance: float = 1e-8,
) -> Solution:
    """Minimise ½‖r(theta)‖² between bounds.

    Parameters
    ----------
    normal : callable
        ``theta (n_parameters,) -> Normal``; may return a cost of inf where the model cannot be evaluated.
    start, low, high : array (n_parameters,)
        Start and bounds; the start is moved inside.
    max_steps : int
        Most trial steps.
    tolerance : float
        Settled when a step's predicted gain falls below this share of the cost.
    """
    theta = np.clip(start, low, high)
    here = normal(theta)
    damping = 1e-6
    for step in range(1, max_steps + 1):
        scale = np.sqrt(np.maximum(np.diag(here.matrix), 1e-300))
        move = _bounded_step(here, scale, damping, low - theta, high - theta)
        gain = -(here.gradient @ move + 0.5 * move @ here.matrix @ move)
        if gain <= tolerance * here.cost:
            return Solution(theta, here, step, True)
        trial = np.clip(theta + move, low, high)  # rounding may lead past a bound
        there = normal(trial)
        ratio = (here.cost - there.cost) / gain if np.isfinite(there.cost) else -1.0
        if ratio > 1e-4:
            theta, here = trial, there
            damping = max(damping * (0.1 if ratio > 0.7 else 0.5), 1e-12)
        elif damping > 1e8:
            return Solution(theta, here, step, True)
        else:
            damping = max(damping, 1e-8) * 10
    return Solution(theta, here, max_steps, False)


def _bounded_step(here: Normal, scale: Array, damping: float, low: Array, high: Array) -> Array:
    """Minimise the damped quadratic model inside the bounds; in parameters scaled to unit curvature."""
    matrix = here.matrix / np.outer(scale, scale) + (damping + 1e-14) * np.eye(len(scale))
    factor, lower = cho_factor(matrix, lower=True)
    free = -cho_solve((factor, lower), here.gradient / scale)
    if np.all(free >= low * scale) and np.all(free <= high * scale):
        return free / scale
    triangle = np.tril(factor).T
    target = np.linalg.solve(triangle.T, -here.gradient / scale)
    box = (np.minimum(low * scale, 0.0), np.maximum(high * scale, 0.0))
    pinned = box[0] == box[1]
    if pinned.any():
        box = (box[0] - 1e-12 * pinned, box[1] + 1e-12 * pinned)
    return np.clip(lsq_linear(triangle, target, bounds=box, method="bvls").x / scale, low, high)
