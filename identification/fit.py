"""Joint fit of all parameters to all recordings: weighted least squares in the analysis band, with covariance.

Output error in torque: measured torque minus the model's along the measured motion, each channel weighted by its own
residual (iteratively reweighted). The covariance is the sandwich over half-second clusters, because what is left over
is never white (White 1980; Liang & Zeger 1986).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .assembly import Assembly, Block
from .experiment import Experiment
from .least_squares import Normal, Solution, minimise

Array = NDArray[np.float64]

CLUSTER = 0.5
"""[s] Residuals further apart than this count as independent in the covariance."""

RANDOM_STARTS = 6
"""Extra starts of a law that is nonlinear in its shape parameters."""


@dataclass(frozen=True)
class Fit:
    """Where the fit ended.

    Parameters
    ----------
    assembly : Assembly
    theta, std : array (P,)
        Parameters in the assembly's order and their standard deviations.
    covariance : array (P, P)
    sigma : array (J,)
        RMS residual of each channel in the analysis band [N·m or N].
    condition : float
        Condition number of the Jacobian with columns scaled to unit length.
    at_bound : array (P,) of bool
    starts, agreed : int
        Starts tried, and how many of them reached the best cost (within 0.1 %).
    """

    assembly: Assembly
    theta: Array
    std: Array
    covariance: Array
    sigma: Array
    condition: float
    at_bound: NDArray[np.bool_]
    starts: int = 1
    agreed: int = 1


def fit(
    assembly: Assembly,
    experiments: Sequence[Experiment],
    *,
    start: Array | None = None,
    multi_start: bool = True,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> Fit:
    """Fit every free parameter of a model to recordings.

    Parameters
    ----------
    assembly : Assembly
    experiments : sequence of Experiment
    start : array (P,), optional
        Where to start; the assembly's own start otherwise.
    multi_start : bool
        Try the grid of every shape parameter and a few random starts. Channels that share no parameter are judged
        apart, so that each takes its own best start.
    seed : int
        Of the random starts.
    progress : callable
        Told in a few words what is under way.
    """
    theta = assembly.start if start is None else np.clip(start, assembly.low, assembly.high)
    n_joints = experiments[0].measured.shape[1]
    sigma = np.sqrt(np.mean(np.concatenate([e.measured for e in experiments]) ** 2, axis=0)) + 1e-12
    shapes = _shapes(assembly)
    starts = agreed = 1
    if multi_start and shapes:
        progress("starting values over the grid of shape parameters")
        theta = _grid_start(assembly, experiments, theta, sigma, shapes)
    solution, sigma = _reweighted(assembly, experiments, theta, sigma)
    if multi_start and shapes:
        groups = _independent_channels(assembly, experiments[0], solution.theta)
        rng = np.random.default_rng(seed)
        costs = [_channel_costs(assembly, experiments, solution.theta, sigma)]
        thetas = [solution.theta]
        for k in range(RANDOM_STARTS):
            progress(f"random start {k + 1} of {RANDOM_STARTS}")
            other = _minimise(assembly, experiments, _random(assembly, thetas[0], shapes, rng), sigma)
            thetas.append(other.theta)
            costs.append(_channel_costs(assembly, experiments, other.theta, sigma))
        best = np.array(thetas[0])
        starts, agreed = len(thetas), len(thetas)
        for channels, index in groups:
            totals = np.array([c[channels].sum() for c in costs])
            best[index] = thetas[int(np.argmin(totals))][index]
            agreed = min(agreed, int(np.count_nonzero(totals <= 1.001 * totals.min())))
        solution, sigma = _reweighted(assembly, experiments, best, sigma)
    theta = solution.theta
    del n_joints
    covariance, condition = _covariance(assembly, experiments, theta, sigma)
    span = np.maximum(np.abs(theta), 1e-12)
    at_bound = (theta - assembly.low <= 1e-6 * span) | (assembly.high - theta <= 1e-6 * span)
    return Fit(assembly, theta, np.sqrt(np.diag(covariance)), covariance, sigma, condition, at_bound, starts, agreed)


def channel_rms(assembly: Assembly, experiments: Sequence[Experiment], theta: Array) -> tuple[Array, Array]:
    """RMS residual and RMS measurement of every channel in the analysis band, each (J,)."""
    residuals = np.concatenate([e.measured - e.motion.to_band(assembly.torque(e, theta)) for e in experiments])
    measured = np.concatenate([e.measured for e in experiments])
    return np.sqrt(np.mean(residuals**2, axis=0)), np.sqrt(np.mean(measured**2, axis=0))


def gather(blocks: Sequence[Block], channel: int) -> tuple[NDArray[np.int_], Array]:
    """Parameters that a channel depends on (k,) and its derivative by them (n, k), columns of one parameter added
    up."""
    own = [b for b in blocks if b.channel == channel and len(b.index)]
    if not own:
        return np.zeros(0, int), np.zeros((0, 0))
    index = np.concatenate([b.index for b in own])
    columns = np.concatenate([b.values for b in own], axis=1)
    unique, inverse = np.unique(index, return_inverse=True)
    if len(unique) == len(index):
        return index, columns
    return unique, columns @ np.eye(len(unique))[inverse]


def _reweighted(
    assembly: Assembly, experiments: Sequence[Experiment], theta: Array, sigma: Array
) -> tuple[Solution, Array]:
    """Alternate fit and channel weights until the weights settle; one channel needs no weight."""
    solution = _minimise(assembly, experiments, theta, sigma)
    for _ in range(4):
        new = channel_rms(assembly, experiments, solution.theta)[0] + 1e-12
        settled = np.all(np.abs(new / sigma - 1) < 0.02)
        sigma = new
        if settled or len(sigma) == 1:
            break
        solution = _minimise(assembly, experiments, solution.theta, sigma)
    return solution, sigma


def _minimise(assembly: Assembly, experiments: Sequence[Experiment], theta: Array, sigma: Array) -> Solution:
    return minimise(lambda x: _normal(assembly, experiments, x, sigma), theta, assembly.low, assembly.high)


def _normal(assembly: Assembly, experiments: Sequence[Experiment], theta: Array, sigma: Array) -> Normal:
    size = len(theta)
    cost, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
    for experiment in experiments:
        residual, blocks = assembly.residual(experiment, theta)
        scaled = residual / sigma
        cost += 0.5 * float(np.sum(scaled**2))
        for c in range(residual.shape[1]):
            index, columns = gather(blocks, c)
            if len(index):
                columns = columns / sigma[c]
                gradient[index] -= columns.T @ scaled[:, c]
                matrix[np.ix_(index, index)] += columns.T @ columns
    return Normal(cost if np.isfinite(cost) else np.inf, gradient, matrix)


def _channel_costs(assembly: Assembly, experiments: Sequence[Experiment], theta: Array, sigma: Array) -> Array:
    return (channel_rms(assembly, experiments, theta)[0] / sigma) ** 2


def _covariance(
    assembly: Assembly, experiments: Sequence[Experiment], theta: Array, sigma: Array
) -> tuple[Array, float]:
    """Cluster-robust covariance (P, P) and the condition number of the scaled Jacobian."""
    normal = _normal(assembly, experiments, theta, sigma)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    scaled = normal.matrix / np.outer(scale, scale)
    values = np.linalg.eigvalsh(scaled)
    condition = float(np.sqrt(values[-1] / max(values[0], 1e-30)))
    inverse = np.linalg.pinv(scaled, rcond=1e-13, hermitian=True) / np.outer(scale, scale)
    meat, clusters = np.zeros_like(inverse), 0
    for experiment in experiments:
        residual, blocks = assembly.residual(experiment, theta)
        score = np.zeros((len(residual), len(theta)))
        for c in range(residual.shape[1]):
            index, columns = gather(blocks, c)
            if len(index):
                score[:, index] += columns * (residual[:, c] / sigma[c] ** 2)[:, None]
        length = max(1, round(CLUSTER * 2 * experiment.motion.band))
        for s in experiment.motion.band_segments():
            edges = np.arange(s.start, s.stop, length)
            if len(edges):
                sums = np.add.reduceat(score[: s.stop], edges, axis=0)
                meat += sums.T @ sums
                clusters += len(sums)
    return inverse @ meat @ inverse * clusters / max(clusters - 1, 1), condition


def _shapes(assembly: Assembly) -> dict[str, list[tuple[int, Array]]]:
    """For every placed effect with shape parameters (by ``effect.at``): position in theta and grid of each."""
    found: dict[str, list[tuple[int, Array]]] = {}
    for p in assembly.placed:
        position = {assembly.slots[i].name: int(i) for i in assembly.index_of(p)}
        grids = [
            (position[x.name], np.array(x.grid) * assembly.scale(p, x))
            for x in p.effect.parameters
            if x.grid and x.name in position
        ]
        if grids:
            found[p.key] = grids
    return found


def _grid_start(
    assembly: Assembly,
    experiments: Sequence[Experiment],
    theta: Array,
    sigma: Array,
    shapes: dict[str, list[tuple[int, Array]]],
) -> Array:
    """Best grid point of every effect's shapes; one pass per effect serves all its places, each judged by itself."""
    theta = theta.copy()
    groups = _independent_channels(assembly, experiments[0], theta)
    for name in dict.fromkeys(key.split(".")[0] for key in shapes):
        members = {key: grids for key, grids in shapes.items() if key.split(".")[0] == name}
        counts = [len(g) for _, g in next(iter(members.values()))]
        best, trials = np.full(len(groups), np.inf), theta.copy()
        for combination in product(*(range(n) for n in counts)):
            trial = theta.copy()
            for grids in members.values():
                for (position, grid), k in zip(grids, combination, strict=True):
                    trial[position] = np.clip(grid[k], assembly.low[position], assembly.high[position])
            amplitudes = np.ones(len(theta), bool)
            amplitudes[[p for grids in shapes.values() for p, _ in grids]] = False
            normal = _normal(assembly, experiments, trial, sigma)
            part = normal.matrix[np.ix_(amplitudes, amplitudes)]
            part = part + 1e-9 * np.diag(np.diag(part) + 1e-30)
            move = np.zeros(len(theta))
            move[amplitudes] = -np.linalg.solve(part, normal.gradient[amplitudes])
            reached = np.clip(trial + move, assembly.low, assembly.high)
            costs = _channel_costs(assembly, experiments, reached, sigma)
            for g, (channels, index) in enumerate(groups):
                if costs[channels].sum() < best[g]:
                    best[g] = costs[channels].sum()
                    trials[index] = reached[index]
        theta = trials
    return theta


def _random(
    assembly: Assembly, theta: Array, shapes: dict[str, list[tuple[int, Array]]], rng: np.random.Generator
) -> Array:
    """A start with every shape parameter drawn log-uniformly over its grid's range."""
    start = theta.copy()
    for grids in shapes.values():
        for position, grid in grids:
            low, high = float(np.min(np.abs(grid))), float(np.max(np.abs(grid)))
            drawn = np.exp(rng.uniform(np.log(low), np.log(high)))
            start[position] = np.clip(drawn, assembly.low[position], assembly.high[position])
    return start


def _independent_channels(
    assembly: Assembly, experiment: Experiment, theta: Array
) -> list[tuple[NDArray[np.int_], NDArray[np.int_]]]:
    """Groups of channels that share no parameter: (channels, parameters) of each."""
    _, blocks = assembly.residual(experiment, theta)
    n_joints = experiment.measured.shape[1]
    label = np.arange(n_joints)
    owner: dict[int, int] = {}
    for b in blocks:
        for i in b.index:
            if i in owner:
                label[label == label[b.channel]] = label[owner[int(i)]]
            else:
                owner[int(i)] = b.channel
    groups = []
    for value in dict.fromkeys(label):
        channels = np.flatnonzero(label == value)
        index = np.array([i for i, c in owner.items() if label[c] == value], int)
        groups.append((channels, index))
    return groups
