"""Effects of a docking fitted with the simulation in the loop, the set-up's numbers free within their tolerances.

Gauss and Newton's steps on the posterior, r' K⁻¹ r + shifts' shifts + the prior of what the model file says, with
derivatives by differences.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.model import Model, Placed
from ..deciding import BASELINE_OWN
from ..fitting.least_squares import Normal, bounded_step
from ..nuisance.covariance import Covariance
from .runs import SHIFTS, Runs

Array = NDArray[np.float64]
Covariances = Sequence[Sequence[Covariance]]
"""Of every recording and channel."""

SMALL = 0.05
"""Step of a difference, as a share of a parameter's own scale; of a shift, one deviation."""
STILL = 0.02
"""A step of less than this share of every scale ends a fit."""
DAMPING = 1e-3


@dataclass(frozen=True)
class At:
    """Effects with their free parameters' values (P,), and the set-up's shifts (S,)."""

    placed: tuple[Placed, ...]
    fixed: dict[str, float]
    values: Array
    shifts: Array

    @property
    def keys(self) -> tuple[str, ...]:
        """Free parameters by ``effect.place.parameter``."""
        return keys_of(self.placed)

    @property
    def all_values(self) -> dict[str, float]:
        """Every parameter of the effects by its key."""
        return self.fixed | dict(zip(self.keys, map(float, self.values), strict=True))

    def with_effects(self, added: Sequence[Placed], values: dict[str, float]) -> "At":
        """With more effects at these values."""
        every = self.all_values | values
        placed = (*self.placed, *added)
        held = {f"{p.key}.{h}": every[f"{p.key}.{h}"] for p in placed for h in p.hold}
        return At(placed, held, np.array([every[k] for k in keys_of(placed)]), self.shifts)

    def without(self, key: str) -> "At":
        """Without an effect."""
        rest = tuple(p for p in self.placed if p.key != key)
        return At(rest, self.fixed, np.array([self.all_values[k] for k in keys_of(rest)]), self.shifts)


def keys_of(placed: Sequence[Placed]) -> tuple[str, ...]:
    """Free parameters by ``effect.place.parameter``."""
    return tuple(f"{p.key}.{x.name}" for p in placed for x in p.effect.parameters if x.name not in p.hold)


def scales_of(placed: Sequence[Placed]) -> Array:
    """A usual size of each free parameter (P,)."""
    free = [x for p in placed for x in p.effect.parameters if x.name not in p.hold]
    return np.array([min(abs(g) for g in x.grid) for x in free])


def start(model: Model) -> At:
    """The model as given; a parameter without a value starts at what hardware usually has."""
    usual = {f"{p.key}.{x.name}": x.grid[0] for p in model.effects for x in p.effect.parameters}
    values = usual | {k: v for k, v in model.values.items() if k in usual}
    return At((), {}, np.zeros(0), np.zeros(len(SHIFTS))).with_effects(model.effects, values)


@dataclass(frozen=True)
class Linear:
    """What recordings say about a fit: residuals (n, c) of each, and columns (n, c, P + S) of what is free there, in
    units of the parameters and of the shifts' deviations."""

    at: At
    residuals: tuple[Array, ...]
    columns: tuple[Array, ...]


def simulate(runs: Runs, numbers: Sequence[int], at: At) -> list[Array]:
    """Channels of some recordings; raises InputError where one cannot be simulated."""
    found = [runs(i, at.all_values, at.shifts) for i in numbers]
    for i, seen in zip(numbers, found, strict=True):
        if seen is None:
            raise InputError(
                f"{runs.records[i].path}: the docking cannot be simulated from where the recording starts; check "
                "[docking] against the test's set-up"
            )
    return [x for x in found if x is not None]


def residuals(runs: Runs, numbers: Sequence[int], seen: Sequence[Array]) -> tuple[Array, ...]:
    """Measurement less simulation, 0 where nothing was measured."""
    return tuple(np.nan_to_num(runs.records[i].measured - x) for i, x in zip(numbers, seen, strict=True))


def linearised(runs: Runs, numbers: Sequence[int], at: At, shifted: Sequence[Array] | None = None) -> Linear:
    """Differences about a fit; ``shifted``: the shifts' columns (n, c, S) of each recording, where they are known."""
    here = simulate(runs, numbers, at)
    columns: list[list[Array]] = [[] for _ in numbers]
    sizes = SMALL * np.maximum(np.abs(at.values), scales_of(at.placed))
    high = np.array([x.high for p in at.placed for x in p.effect.parameters if x.name not in p.hold])
    for k, size in enumerate(sizes):
        step = size if at.values[k] + size <= high[k] else -size
        moved = replace(at, values=at.values + step * np.eye(len(at.values))[k])
        for own, a, b in zip(columns, here, simulate(runs, numbers, moved), strict=True):
            own.append((b - a) / step)
    if shifted is None:
        for k in range(len(SHIFTS)):
            moved = replace(at, shifts=at.shifts + np.eye(len(SHIFTS))[k])
            for own, a, b in zip(columns, here, simulate(runs, numbers, moved), strict=True):
                own.append(b - a)
    stacked = [np.stack(own, axis=2) if own else np.zeros((*a.shape, 0)) for own, a in zip(columns, here, strict=True)]
    if shifted is not None:
        stacked = [np.concatenate([a, b], axis=2) for a, b in zip(stacked, shifted, strict=True)]
    return Linear(at, residuals(runs, numbers, here), tuple(stacked))


def shift_columns(linear: Linear) -> list[Array]:
    """The shifts' columns of each recording."""
    return [x[:, :, len(linear.at.values) :] for x in linear.columns]


def priors(model: Model, at: At) -> tuple[Array, Array]:
    """Mean and standard deviation of each free parameter (P,): of what the model file gives, a share of its value; of
    what it does not, none to speak of."""
    mean, spread = at.values.copy(), np.full(len(at.values), np.inf)
    own = start(model).all_values
    for k, key in enumerate(at.keys):
        if key in own:
            mean[k] = own[key]
            spread[k] = BASELINE_OWN * max(abs(mean[k]), scales_of(at.placed)[k])
    return mean, spread


def cost(at: At, left: Sequence[Array], covariances: Covariances, prior: tuple[Array, Array]) -> float:
    """Twice minus the log posterior."""
    total = float(at.shifts @ at.shifts + np.sum(((at.values - prior[0]) / prior[1]) ** 2))
    for r, row in zip(left, covariances, strict=True):
        total += sum(float(r[:, c] @ k.solve(r[:, c])) for c, k in enumerate(row))
    return total


def fit(
    runs: Runs,
    numbers: Sequence[int],
    model: Model,
    at: At,
    covariances: Covariances,
    shifted: Sequence[Array] | None = None,
    most: int = 4,
) -> Linear:
    """Climb the posterior from a start; ``shifted`` as of `linearised`."""
    prior = priors(model, at)
    here = linearised(runs, numbers, at, shifted)
    shifted = shift_columns(here)
    now = cost(at, here.residuals, covariances, prior)
    size = np.concatenate([scales_of(at.placed), np.ones(len(SHIFTS))])
    low = np.array([x.low for p in at.placed for x in p.effect.parameters if x.name not in p.hold])
    high = np.array([x.high for p in at.placed for x in p.effect.parameters if x.name not in p.hold])
    for _ in range(most):
        gradient, matrix = normal(here, covariances, prior)
        theta = np.concatenate([here.at.values, here.at.shifts])
        bottom = np.concatenate([low, np.full(len(SHIFTS), -4.0)]) - theta
        top = np.concatenate([high, np.full(len(SHIFTS), 4.0)]) - theta
        move = bounded_step(Normal(0.0, gradient, matrix), np.sqrt(np.diag(matrix)), DAMPING, bottom, top)
        for share in (1.0, 0.5, 0.2):
            there = theta + share * move
            tried = replace(here.at, values=there[: len(at.values)], shifts=there[len(at.values) :])
            try:
                left = residuals(runs, numbers, simulate(runs, numbers, tried))
            except InputError:
                continue
            value = cost(tried, left, covariances, prior)
            if value < now:
                gained, now = now - value, value
                here = linearised(runs, numbers, tried, shifted)
                break
        else:
            break
        if np.all(np.abs(share * move) < STILL * size) or gained < STILL:
            break
    return here


def normal(here: Linear, covariances: Covariances, prior: tuple[Array, Array]) -> tuple[Array, Array]:
    """Gradient and normal matrix of half the cost, over parameters and shifts."""
    at = here.at
    weight = np.concatenate([1 / prior[1] ** 2, np.ones(len(SHIFTS))])
    away = np.concatenate([np.where(np.isfinite(prior[1]), at.values - prior[0], 0.0), at.shifts])
    gradient, matrix = weight * away, np.diag(weight)
    for r, x, row in zip(here.residuals, here.columns, covariances, strict=True):
        for c, k in enumerate(row):
            solved = k.solve(x[:, c])
            gradient = gradient - solved.T @ r[:, c]
            matrix = matrix + x[:, c].T @ solved
    return gradient, matrix
