"""Joint fit of all parameters to all recordings: weighted least squares in the analysis band, with covariance.

Output error in torque: measured torque minus the model's along the measured motion, each channel weighted by its own
residual (iteratively reweighted). The covariance is the sandwich over half-second clusters, because the residual is
never white (White 1980; Liang & Zeger 1986).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .assembly import TorqueModel
from .experiment import Experiment
from .problem import Problem, split
from .starts import best_start

Array = NDArray[np.float64]

CLUSTER = 0.5
"""[s] Residuals further apart than this count as independent in the covariance."""

WEAK = 1e-13
"""Share of the largest eigenvalue of the scaled normal matrix below which a direction counts as unknown."""

PART = 1e-6
"""Share of a parameter in unknown directions from which on it is unknown itself; less is rounding."""


@dataclass(frozen=True)
class Fit:
    """The result of a fit.

    Parameters
    ----------
    assembly : TorqueModel
    theta, std : array (P,)
        Parameters in the assembly's order and their standard deviations; inf where the data say nothing.
    covariance : array (P, P)
        Of the directions that the data carry.
    sigma : array (J,)
        RMS residual of each channel in the analysis band [N·m or N].
    condition : float
        Condition number of the Jacobian with columns scaled to unit length.
    at_bound : array (P,) of bool
    starts, agreed : int
        Starts tried where most were needed, and how many of them reached the best cost there (within 0.1 %).
    """

    assembly: TorqueModel
    theta: Array
    std: Array
    covariance: Array
    sigma: Array
    condition: float
    at_bound: NDArray[np.bool_]
    starts: int = 1
    agreed: int = 1


def fit(
    assembly: TorqueModel,
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
    assembly : TorqueModel
    experiments : sequence of Experiment
    start : array (P,), optional
        Where to start; the assembly's own start otherwise.
    multi_start : bool
        Try starts from everywhere in the grids of shape parameters, apart for channels that share no parameter.
    seed : int
        Of the random starts.
    progress : callable
        Told in a few words what is under way.
    """
    theta = np.array(assembly.start if start is None else np.clip(start, assembly.low, assembly.high))
    sigma = np.sqrt(np.mean(np.concatenate([e.measured for e in experiments]) ** 2, axis=0)) + 1e-12
    rng = np.random.default_rng(seed)
    starts = agreed = 1
    problems = split(assembly, experiments, theta)
    for number, problem in enumerate(problems, 1):
        here, weights = theta[problem.index], sigma[problem.channels]
        if multi_start:
            progress(f"starting values, {number} of {len(problems)} independent parts")
            here, tried, reached = best_start(problem, here, weights, rng)
            if tried > starts or number == 1:
                starts, agreed = tried, reached
        theta[problem.index] = _reweighted(problem, here, weights)
    sigma = channel_rms(assembly, experiments, theta)[0] + 1e-12
    covariance, std, condition = _covariance(assembly, experiments, theta, sigma)
    span = np.maximum(np.abs(theta), 1e-12)
    at_bound = (theta - assembly.low <= 1e-6 * span) | (assembly.high - theta <= 1e-6 * span)
    return Fit(assembly, theta, std, covariance, sigma, condition, at_bound, starts, agreed)


def channel_rms(assembly: TorqueModel, experiments: Sequence[Experiment], theta: Array) -> tuple[Array, Array]:
    """RMS residual and RMS measurement of every channel in the analysis band, each (J,), over samples that count.

    Of a channel that is silent in all, the largest measurement of the others stands for its own; of one that nothing
    drives, the rigid body's torque.
    """
    residuals = np.concatenate([e.measured - e.all_to_band(assembly.torque(e, theta)) for e in experiments])
    measured = np.concatenate([e.measured for e in experiments])
    undriven = list(experiments[0].motion.undriven)
    if undriven:
        modelled = np.concatenate([e.all_to_band(e.modelled) for e in experiments])
        measured[:, undriven] = modelled[:, undriven]
    counted = np.maximum(np.sum([e.counted for e in experiments], axis=0), 1)
    size = np.sqrt(np.sum(measured**2, axis=0) / counted)
    size[sorted(set.intersection(*(set(e.motion.silent) for e in experiments)))] = size.max()
    return np.sqrt(np.sum(residuals**2, axis=0) / counted), size


def _reweighted(problem: Problem, theta: Array, sigma: Array) -> Array:
    """Alternate fit and channel weights until the weights settle; one channel needs no weight."""
    for _ in range(5):
        theta = problem.minimise(theta, sigma).theta
        if len(sigma) == 1:
            break
        last, sigma = sigma, problem.rms(theta) + 1e-12
        if np.all(np.abs(sigma / last - 1) < 0.02):
            break
    return theta


def _covariance(
    assembly: TorqueModel, experiments: Sequence[Experiment], theta: Array, sigma: Array
) -> tuple[Array, Array, float]:
    """Cluster-robust covariance (P, P), standard deviations (P,), and the condition number of the scaled Jacobian.

    Directions that the data say nothing about are left out of the covariance; a parameter that has a part in them has
    an infinite standard deviation.
    """
    if not len(theta):
        return np.zeros((0, 0)), np.zeros(0), 1.0
    whole = Problem(assembly, tuple(experiments), np.arange(len(sigma)), np.arange(len(theta)))
    matrix, meat, clusters = np.zeros((len(theta), len(theta))), np.zeros((len(theta), len(theta))), 0
    for experiment in experiments:
        score = np.zeros((len(experiment.measured), len(theta)))
        for (residual, index, columns), s in zip(whole.channel_fits(experiment, theta), sigma, strict=True):
            matrix[np.ix_(index, index)] += columns.T @ columns / s**2
            score[:, index] += columns * (residual / s**2)[:, None]
        length = max(1, round(CLUSTER * 2 * experiment.motion.band))
        for part in experiment.motion.band_segments():
            edges = np.arange(part.start, part.stop, length)
            if len(edges):
                sums = np.add.reduceat(score[: part.stop], edges, axis=0)
                meat += sums.T @ sums
                clusters += len(sums)
    scale = np.maximum(np.sqrt(np.diag(matrix)), 1e-12)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    known = values > WEAK * values[-1]
    half = vectors[:, known] / np.sqrt(values[known]) / scale[:, None]
    inverse = half @ half.T
    covariance = inverse @ meat @ inverse * clusters / max(clusters - 1, 1)
    unknown = np.sum(vectors[:, ~known] ** 2, axis=1) > PART
    condition = float(np.sqrt(values[-1] / max(values[0], 1e-30)))
    return covariance, np.where(unknown, np.inf, np.sqrt(np.diag(covariance))), condition
