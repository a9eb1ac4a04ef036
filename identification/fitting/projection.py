"""Least squares for models that are linear in most of their parameters: variable projection on normal equations.

The search runs over the shape parameters s alone; for every s the amplitudes a are solved between their bounds. Where
amplitude and shape trade off along a curved valley, as they do in friction curves, this gets to the end where a search
over both crawls (Golub & Pereyra 1973). A step is Kaufman's (1975): the Schur complement of the normal equations.
Amplitudes for a new s are predicted to first order, so that a point takes one pass over the samples or two.
"""

import numpy as np
from numpy.typing import NDArray

from .least_squares import NormalEquations, Objective, Solution, bounded_step, minimise

Array = NDArray[np.float64]

WORTH_A_PASS = 0.2
"""Share of the progress made that solving the amplitudes must promise before the model is evaluated again there."""

_RIDGE = 1e-10


def minimise_projected(
    objective: Objective, start: Array, shapes: NDArray[np.bool_], *, max_steps: int = 60, tolerance: float = 1e-8
) -> Solution:
    """Minimise ½‖r(theta)‖² between bounds; as `least_squares.minimise`, for r linear in all but some parameters.

    Shapes that must be positive are searched in their logarithms, and no step takes one further than e times.

    Parameters
    ----------
    objective : Objective
    start : array (P,)
    shapes : array (P,) of bool
        Parameters that r is not linear in. Linearity in the others is used for speed, not trusted: what is
        returned was evaluated.
    max_steps, tolerance
        As for `least_squares.minimise`; steps are in the shapes.
    """
    if not shapes.any():
        return minimise(objective, start, max_steps=max_steps, tolerance=tolerance)
    search = _Search(objective, np.clip(start, objective.low, objective.high), shapes)
    low, high = objective.low[shapes], objective.high[shapes]
    positive = low > 0

    def scaled(values: Array) -> Array:
        return np.where(positive, np.log(np.where(positive, values, 1.0)), values)

    def normal(coordinates: Array) -> NormalEquations:
        power = np.exp(np.where(positive, coordinates, 0.0))
        reduced = search(np.clip(np.where(positive, power, coordinates), low, high))
        return NormalEquations(reduced.cost, reduced.gradient * power, reduced.matrix * np.outer(power, power))

    found = minimise(
        Objective(normal, scaled(low), scaled(high)),
        scaled(search.theta[shapes]),
        max_steps=max_steps,
        tolerance=tolerance,
        damping=1e-2,
        stride=np.where(positive, 1.0, np.inf),
    )
    return Solution(search.theta, search.here, found.steps, found.settled)


def project(
    objective: Objective, theta: Array, shapes: NDArray[np.bool_], scale: Array | float = 0.0
) -> tuple[Array, float, NormalEquations]:
    """Solve the amplitudes, shapes held: parameters (P,), cost there, normal equations at ``theta``.

    ``scale`` is the most influence that each parameter is known to have: one that lost nearly all of it stays.
    """
    here = objective.normal(theta)
    if not np.isfinite(here.cost):
        return theta, np.inf, here
    room = np.where(shapes, 0.0, objective.low - theta), np.where(shapes, 0.0, objective.high - theta)
    move = bounded_step(here, np.maximum(scale, np.sqrt(np.diag(here.matrix))), _RIDGE, *room)
    cost = here.cost + float(here.gradient @ move + 0.5 * move @ here.matrix @ move)
    return np.clip(theta + move, objective.low, objective.high), cost, here


class _Search:
    """The reduced problem as a function of the shapes; keeps the best point it has been asked for."""

    def __init__(self, objective: Objective, start: Array, shapes: NDArray[np.bool_]) -> None:
        self._objective, self._shapes = objective, shapes
        self.theta, self.here = start, NormalEquations(np.inf, np.zeros(len(start)), np.zeros((len(start), len(start))))
        self._follow = np.zeros((len(start), np.count_nonzero(shapes)))
        self._scale = np.zeros(len(start))

    def __call__(self, shape: Array) -> NormalEquations:
        forecast = self.theta + self._follow @ (shape - self.theta[self._shapes])
        forecast[self._shapes] = shape
        low, high = self._objective.low, self._objective.high
        forecast = np.clip(forecast, low, high)
        theta, cost, here = project(self._objective, forecast, self._shapes, self._scale)
        if not np.isfinite(cost):
            return NormalEquations(np.inf, np.zeros(len(shape)), np.zeros((len(shape), len(shape))))
        self._scale = np.maximum(self._scale, np.sqrt(np.diag(here.matrix)))
        progress = self.here.cost - cost if np.isfinite(self.here.cost) else 0.0
        if here.cost - cost > WORTH_A_PASS * abs(progress):
            there = self._objective.normal(theta)
            theta, here = (theta, there) if there.cost < here.cost else (forecast, here)
        else:
            theta = forecast
        free = ~self._shapes & (theta > low) & (theta < high)
        reduced, follow = _schur(here, free, self._shapes, self._scale)
        if here.cost < self.here.cost:
            self.theta, self.here = theta, here
            self._follow = np.zeros_like(self._follow)
            self._follow[free] = follow
        return reduced


def _schur(
    here: NormalEquations, free: NDArray[np.bool_], shapes: NDArray[np.bool_], scale: Array
) -> tuple[NormalEquations, Array]:
    """Normal equations of the shapes with free amplitudes following, and how they follow (n_free, n_shapes)."""
    scale = np.where(scale > 0, scale, np.inf)[free]  # amplitudes without influence stay
    own = here.matrix[np.ix_(free, free)] / np.outer(scale, scale) + _RIDGE * np.eye(len(scale))
    cross = here.matrix[np.ix_(free, shapes)] / scale[:, None]
    solved = np.linalg.solve(own, np.column_stack([cross, here.gradient[free] / scale]))
    follow, rest = solved[:, :-1], solved[:, -1]
    gradient = here.gradient[shapes] - cross.T @ rest
    matrix = here.matrix[np.ix_(shapes, shapes)] - cross.T @ follow
    # Rounding must not turn a direction that amplitudes mimic wholly into one of negative curvature.
    matrix = matrix + 1e-12 * np.diag(np.diag(here.matrix)[shapes])
    return NormalEquations(here.cost, gradient, 0.5 * (matrix + matrix.T)), -follow / scale[:, None]
