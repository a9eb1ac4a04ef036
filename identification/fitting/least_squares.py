"""Bounded nonlinear least squares on normal equations: Levenberg–Marquardt with Marquardt's scaling.

One pass over the samples gives cost, gradient and normal matrix; the (n, P) Jacobian need never
stand in memory at once, which is what makes it quicker than a general solver where samples are many and parameters few
(Levenberg 1944; Marquardt 1963). Where residuals stay large, the curvature that the normal matrix lacks is learnt from
the steps, and used while it predicts them better. Bounds are kept by solving each step's quadratic program (Stark &
Parker 1995, BVLS).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

_GROWTH = 10.0


@dataclass(frozen=True)
class NormalEquations:
    """Cost ½‖r‖², its gradient Jᵀr (P,), and the normal matrix JᵀJ (P, P)."""

    cost: float
    gradient: Array
    matrix: Array


@dataclass(frozen=True)
class Objective:
    """½‖r(theta)‖² and the bounds that its parameters keep.

    Parameters
    ----------
    normal : callable
        ``theta (P,) -> Normal``; may return a cost of inf where the model cannot be evaluated.
    low, high : array (P,)
    """

    normal: Callable[[Array], NormalEquations]
    low: Array
    high: Array


@dataclass(frozen=True)
class Solution:
    """Where the search ended: parameters, the normal equations there, steps taken, and whether it settled."""

    theta: Array
    normal: NormalEquations
    steps: int
    settled: bool


def minimise(
    objective: Objective,
    start: Array,
    *,
    max_steps: int = 60,
    tolerance: float = 1e-8,
    damping: float = 1e-6,
    stride: Array | float = np.inf,
) -> Solution:
    """Minimise ½‖r(theta)‖² between bounds.

    Parameters
    ----------
    objective : Objective
    start : array (P,)
        It is moved inside the bounds.
    max_steps : int
        Most trial steps.
    tolerance : float
        Settled when a step's predicted gain falls below this share of the cost.
    damping : float
        To begin with: 0 where the model is linear, more where its first step is not to be believed.
    stride : float or array (P,)
        Most that a parameter may change in one step.
    """
    normal, low, high = objective.normal, objective.low, objective.high
    theta = np.clip(start, low, high)
    here = normal(theta)
    if not np.isfinite(here.cost):
        return Solution(theta, here, 0, False)
    growth = _GROWTH
    scale = np.zeros(len(theta))
    bend, bent = np.zeros_like(here.matrix), False
    for step in range(1, max_steps + 1):
        # The largest influence so far (Moré 1978): a parameter that loses its influence stays, it does not run away.
        scale = np.maximum(scale, np.sqrt(np.diag(here.matrix)))
        model = NormalEquations(here.cost, here.gradient, here.matrix + bend) if bent else here
        try:
            move = bounded_step(
                model, scale, damping, np.maximum(low - theta, -stride), np.minimum(high - theta, stride)
            )
        except np.linalg.LinAlgError:
            bent = False  # not convex: the plain model always is
            continue
        gain = -(here.gradient @ move + 0.5 * move @ model.matrix @ move)
        if gain <= tolerance * here.cost:
            return Solution(theta, here, step, True)
        trial = np.clip(theta + move, low, high)  # rounding may lead past a bound
        there = normal(trial)
        ratio = (here.cost - there.cost) / gain if np.isfinite(there.cost) else -1.0
        if ratio > 1e-4:
            move = trial - theta
            bend = _secant(bend, there.gradient - here.gradient, there.matrix, move)
            miss = there.cost - here.cost - here.gradient @ move - 0.5 * move @ here.matrix @ move
            bent = abs(miss - 0.5 * move @ bend @ move) < abs(miss)
            theta, here = trial, there
            damping = max(damping * (0.1 if ratio > 0.7 else 0.5 if ratio > 0.25 else 2.0), 1e-12)
            growth = _GROWTH
        elif bent:
            bent = False
        elif damping > 1e8:
            return Solution(theta, here, step, True)
        else:
            damping = max(damping, 1e-8) * growth
            growth *= 3  # a row of refusals: the damping is far too low (Nielsen 1999)
    return Solution(theta, here, max_steps, False)


def _secant(bend: Array, change: Array, matrix: Array, move: Array) -> Array:
    """Curvature that the normal matrix lacks, from how the gradient changed over a step (Dennis, Gay & Welsch 1981)."""
    along = float(change @ move)
    if along <= 0:
        return bend
    wanted = change - matrix @ move
    size = abs(float(move @ bend @ move))
    share = min(1.0, abs(float(move @ wanted)) / size) if size > 0 else 1.0
    miss = wanted - share * bend @ move
    pair = np.outer(miss, change) / along
    return share * bend + pair + pair.T - (miss @ move) * np.outer(change, change) / along**2


def bounded_step(here: NormalEquations, scale: Array, damping: float, low: Array, high: Array) -> Array:
    """Minimise the quadratic model of the cost, damped by ``damping * scale**2``, between bounds on the step.

    Parameters with ``scale`` 0 (no influence) or with ``low == high`` stay where they are.
    """
    move = np.zeros(len(scale))
    free = (scale > 0) & (low < high)
    if not free.any():
        return move
    unit, low, high = scale[free], low[free], high[free]
    matrix = here.matrix[np.ix_(free, free)] / np.outer(unit, unit) + (damping + 1e-14) * np.eye(len(unit))
    gradient = here.gradient[free] / unit
    factor = cho_factor(matrix, lower=True)
    step = -cho_solve(factor, gradient)
    low, high = low * unit, high * unit
    if np.any(step < low) or np.any(step > high):
        triangle = np.tril(factor[0])
        target = -solve_triangular(triangle, gradient, lower=True)
        step = np.clip(lsq_linear(triangle.T, target, bounds=(low, high), method="bvls").x, low, high)
    move[free] = step / unit
    return move
