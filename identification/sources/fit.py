"""Effects fitted with the simulation in the loop, the shifts free within their deviations.

Gauss and Newton's steps on the posterior, r' K⁻¹ r + shifts' shifts + the prior of what the model file says.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..deciding import BASELINE_OWN
from ..fitting.least_squares import NormalEquations, bounded_step
from ..nuisance.covariance import Covariance
from .source import Linearisation, ModelPoint, Source

Array = NDArray[np.float64]
Covariances = Sequence[Sequence[Covariance]]
"""Of every recording and channel."""

SMALL = 0.05
"""Step of a difference, as a share of a parameter's own scale; of a shift, one deviation."""
STILL = 0.02
"""A step of less than this share of every scale, or one that gains less log posterior, ends a fit."""
DAMPING = 1e-3
FARTHEST = 4.0
"""Most that a shift is moved [deviations]."""


def forecast(source: Source, i: int, at: ModelPoint) -> Array:
    """Channels of a recording (n, c); raises InputError where they cannot be predicted."""
    found = source.predicted(i, at)
    if found is None:
        raise source.refused(i)
    return found


def residuals(source: Source, numbers: Sequence[int], at: ModelPoint) -> tuple[Array, ...]:
    """Measurement minus prediction, 0 where nothing was measured."""
    return tuple(np.nan_to_num(source.measured(i) - forecast(source, i, at)) for i in numbers)


def linearised(
    source: Source, numbers: Sequence[int], at: ModelPoint, known: Sequence[Array] | None = None
) -> Linearisation:
    """Residuals and slopes about a fit; ``known``: columns (n, c, p + S) of each recording that are, of the first p
    parameters and of the shifts."""
    columns, left, n_shifts = [], [], len(at.shifts)
    for k, i in enumerate(numbers):
        here = forecast(source, i, at)
        left.append(np.nan_to_num(source.measured(i) - here))
        there = source.shift_slopes(i, at, here) if known is None else known[k]
        p = there.shape[2] - n_shifts
        columns.append(np.concatenate([there[:, :, :p], source.slopes(i, at.held(p), here), there[:, :, p:]], axis=2))
    return Linearisation(at, tuple(left), tuple(columns))


def changes(none: Array, seen: Iterable[tuple[Array | None, float]]) -> Array:
    """Change of a simulation from ``none`` (n, c) for a unit of each amplitude (n, c, k): what is seen with each, None
    where that cannot be predicted, and the amplitude."""
    return np.stack([(np.full_like(none, np.nan) if x is None else x - none) / step for x, step in seen], axis=2)


def differences(source: Source, i: int, at: ModelPoint, here: Array) -> Array:
    """Derivatives (n, c, P) by finite differences, for a source without derivatives."""
    own = []
    for k, (p, x) in enumerate(at.free):
        size = SMALL * max(abs(at.values[k]), source.size(p, x))
        step = size if at.values[k] + size <= source.bounds(p, x)[1] else -size
        moved = replace(at, values=at.values + step * np.eye(len(at.values))[k])
        own.append((forecast(source, i, moved) - here) / step)
    return np.stack(own, axis=2) if own else np.zeros((*here.shape, 0))


def shift_differences(source: Source, i: int, at: ModelPoint, here: Array) -> Array:
    """Derivatives by the shifts (n, c, S), by differences of one deviation."""
    units = np.eye(len(at.shifts))
    return np.stack([forecast(source, i, replace(at, shifts=at.shifts + u)) - here for u in units], axis=2)


def shift_columns(linear: Linearisation) -> list[Array]:
    """The shifts' columns of each recording."""
    return [x[:, :, len(linear.at.values) :] for x in linear.columns]


def kept_columns(source: Source, linear: Linearisation) -> list[Array] | None:
    """The shifts' columns of each recording as a fit from another point may keep them; None where they change on the
    way, or with what the model has."""
    return None if source.bent else shift_columns(linear)


def sizes_of(source: Source, at: ModelPoint) -> Array:
    """A usual size of each free parameter (P,)."""
    return np.array([source.size(p, x) for p, x in at.free])


def bounds_of(source: Source, at: ModelPoint) -> tuple[Array, Array]:
    """Least and greatest of each free parameter, and of the shifts (P + S,)."""
    pairs = [source.bounds(p, x) for p, x in at.free] + [(-FARTHEST, FARTHEST)] * len(at.shifts)
    low, high = np.array(pairs).reshape(-1, 2).T
    return low, high


def priors(source: Source, given: ModelPoint, at: ModelPoint) -> tuple[Array, Array]:
    """Mean and standard deviation of each free parameter's prior (P,): a share of the value that the model file gives;
    very wide without such a value.
    """
    mean, spread = at.values.copy(), np.full(len(at.values), np.inf)
    own, sizes = given.all_values, sizes_of(source, at)
    for k, key in enumerate(at.keys):
        if key in own:
            mean[k] = own[key]
            spread[k] = BASELINE_OWN * max(abs(mean[k]), sizes[k])
    return mean, spread


def cost(at: ModelPoint, left: Sequence[Array], covariances: Covariances, prior: tuple[Array, Array]) -> float:
    """Twice minus the log posterior."""
    total = float(at.shifts @ at.shifts + np.sum(((at.values - prior[0]) / prior[1]) ** 2))
    for r, row in zip(left, covariances, strict=True):
        total += sum(float(r[:, c] @ k.solve(r[:, c])) for c, k in enumerate(row))
    return total


def fit(
    source: Source,
    given: ModelPoint,
    at: ModelPoint,
    covariances: Covariances,
    known: Sequence[Array] | None = None,
    most: int = 0,
) -> Linearisation:
    """Maximise the posterior of the training recordings from a start, in ``most`` steps or as many as the source has;
    ``known`` as in `linearised`; without it the shifts' columns are those of the start, or of each step if they bend.
    """
    numbers, prior, n = source.train, priors(source, given, at), len(at.values)
    here = linearised(source, numbers, at, known)
    known = kept_columns(source, here) if known is None else known
    now = cost(at, here.residuals, covariances, prior)
    size = np.concatenate([sizes_of(source, at), np.ones(len(at.shifts))])
    low, high = bounds_of(source, at)
    for _ in range(most or source.steps):
        gradient, matrix = normal(here, covariances, prior)
        theta = np.concatenate([here.at.values, here.at.shifts])
        scale = np.sqrt(np.diag(matrix))
        move = bounded_step(NormalEquations(0.0, gradient, matrix), scale, DAMPING, low - theta, high - theta)
        for share in (1.0, 0.5, 0.2):
            there = theta + share * move
            tried = replace(here.at, values=there[:n], shifts=there[n:])
            try:
                left = residuals(source, numbers, tried)
            except InputError:
                continue
            value = cost(tried, left, covariances, prior)
            if value < now:
                gained, now = now - value, value
                here = linearised(source, numbers, tried, known)
                break
        else:
            break
        if np.all(np.abs(share * move) < STILL * size) or gained < STILL:
            break
    settled = source.settled(here.at, numbers)
    return here if settled is here.at else linearised(source, numbers, settled, known)


def normal(here: Linearisation, covariances: Covariances, prior: tuple[Array, Array]) -> tuple[Array, Array]:
    """Gradient and normal matrix of half the cost, over parameters and shifts."""
    at = here.at
    weight = np.concatenate([1 / prior[1] ** 2, np.ones(len(at.shifts))])
    away = np.concatenate([np.where(np.isfinite(prior[1]), at.values - prior[0], 0.0), at.shifts])
    gradient, matrix = weight * away, np.diag(weight)
    for r, x, row in zip(here.residuals, here.columns, covariances, strict=True):
        for c, k in enumerate(row):
            solved = k.solve(x[:, c])
            gradient = gradient - solved.T @ r[:, c]
            matrix = matrix + x[:, c].T @ solved
    return gradient, matrix


def deviations(source: Source, given: ModelPoint, here: Linearisation, covariances: Covariances) -> tuple[Array, Array]:
    """Standard deviation of each free parameter (P,), with the shifts free within their deviations; and the normal
    matrix (P, P).
    """
    _, matrix = normal(here, covariances, priors(source, given, here.at))
    size, n = np.sqrt(np.maximum(np.diag(matrix), 1e-300)), len(here.at.values)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-12)), 0)) / size
    return spread[:n], matrix[:n, :n]
