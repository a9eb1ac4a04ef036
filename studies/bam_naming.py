"""Naming what a position servo's friction lacks, by simulation in the loop: the position itself is predicted.

A servo that sticks most of the time tells inverse dynamics little: while it sticks, any torque up to the level will
do. In its own closed loop, where it sticks is the best witness. Each law of the vocabulary is added in turn, everything
is fitted again, and a law is named when it explains a share of the squared position error worth a name, and, fitted
without each controller gain in turn, predicts the recordings left out better, and those of no gain worse by such a
share. Among those that do, the best score wins: log-likelihood predicted less ½ log(samples) for each parameter,
clusters of half a second as samples; of scores as good as equal, that with the fewest parameters.

Sticking makes slopes unreliable: fits go down by Gauss-Newton with coarse steps, and the best are finished without
slopes by CMA-ES (Hansen 2016).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ..models.effects import effects
from .bam_servo import FRICTION, ServoRun, simulate

Array = NDArray[np.float64]
Values = Mapping[str, float]

WORTH = 0.05
"""Least share of the squared position error that a law must explain to be named, and that is called worse."""

TIE = 2.0
"""Difference of two scores that says nothing (Kass and Raftery 1995: not worth more than a bare mention)."""

MOST_ROUNDS = 3
MOST_LEFT_OUT = 3
"""Candidates of a round that are tried on gains left out: those that explain most."""

EVALUATIONS, FEWER = 900, 300
"""Of all recordings by CMA-ES: for a model that is kept, and for one without a gain."""

CLUSTER = 0.5
"""[s] Position errors further apart than this count as independent."""

COARSE = 0.02
"""Relative step of slopes, wide enough to see past single instants of sticking."""

SCALES = {
    "torque_per_volt": 0.1,
    "back_emf": 0.3,
    "rotor_inertia": 2e-3,
    "zero": 0.02,
    "viscous_friction.coefficient": 0.01,
    "quadratic_friction.coefficient": 1e-3,
    "load_dependent_friction.coefficient": 0.2,
    "harness_stiffness.stiffness": 0.02,
    "asymmetric_friction.coefficient_difference": 0.01,
}
"""Usual sizes; torques 0.01 N·m, shapes 1."""

START = {
    "torque_per_volt": 0.08,
    "back_emf": 0.36,
    "rotor_inertia": 1.5e-3,
    "zero": 0.02,
    "viscous_friction.coefficient": 0.01,
    "coulomb_friction.level": 0.01,
}
"""Coulomb and viscous friction, and the motor: what is fitted always."""


@dataclass(frozen=True)
class ServoFit:
    """Values, and the RMS position error of the recordings that they were fitted to [rad]."""

    values: Values
    error: float


@dataclass(frozen=True)
class LawTrial:
    """A law added to a model: the fit, the share of the squared error it explains, the same share of each controller
    gain's recordings predicted by fits to the others (empty where that was not tried), and the score of that."""

    name: str
    fit: ServoFit
    explained: float
    forecast: Mapping[float, float] = field(default_factory=dict)
    score: float = -np.inf

    @property
    def passes(self) -> bool:
        """Whether it is worth a name, and what was left out was predicted better, for no gain much worse."""
        return self.explained > WORTH and self.score > 0 and min(self.forecast.values()) > -WORTH


@dataclass(frozen=True)
class Round:
    """Candidates, those that explain most first, and the one that was named."""

    tried: tuple[LawTrial, ...]
    named: LawTrial | None


def rms(runs: Sequence[ServoRun], values: Values) -> float:
    """RMS of the simulated position's error over all samples [rad]."""
    return float(np.sqrt(np.mean(_errors(runs, values) ** 2)))


def fit(runs: Sequence[ServoRun], start: Values, evaluations: int = EVALUATIONS, seed: int = 0) -> ServoFit:
    """Fit all values given, by Gauss-Newton with coarse slopes, then by CMA-ES.

    Parameters
    ----------
    runs : sequence of ServoRun
    start : mapping of str to float
        What is fitted, and where it starts.
    evaluations : int
        Of the recordings, by CMA-ES; 0 leaves it out.
    seed : int
    """
    names = list(start)
    size = np.array([SCALES.get(n, 1.0 if _is_shape(n) else 0.01) for n in names])
    low = np.array([_low(n) for n in names]) / size
    x = np.maximum(np.array([start[n] for n in names]) / size, low + 1e-6)

    def residual(z: Array) -> Array:
        return _errors(runs, dict(zip(names, z * size, strict=True)))

    def cost(z: Array) -> float:
        return float(np.sqrt(np.mean(residual(z) ** 2)))

    best = cost(x)
    for step in (COARSE, COARSE / 4):
        found = least_squares(residual, x, bounds=(low, np.inf), diff_step=step, max_nfev=12)
        if cost(found.x) < best:
            best, x = cost(found.x), np.array(found.x, float)
    if evaluations:
        further = evolve(cost, x, low, evaluations, seed)
        if cost(further) < best:
            best, x = cost(further), further
    return ServoFit(dict(zip(names, (x * size).tolist(), strict=True)), best)


def candidates(have: Values) -> dict[str, list[Values]]:
    """Laws that a model does not have yet, each with points to start from."""
    found = {}
    for name in FRICTION:
        if any(key.startswith(f"{name}.") for key in have):
            continue
        shapes = [p for p in effects()[name].parameters if p.grid]
        found[name] = [
            {
                f"{name}.{p.name}": shape if p.grid else 0.3 * SCALES.get(f"{name}.{p.name}", 0.01)
                for p in effects()[name].parameters
            }
            for shape in ((0.5, 2.0) if shapes else (0.0,))
        ]
    return found


def name_missing(
    runs: Sequence[ServoRun], base: ServoFit, progress: Callable[[str], None] = lambda _: None
) -> Iterator[Round]:
    """Add laws to a model, one a round, until none passes.

    Parameters
    ----------
    runs : sequence of ServoRun
        Training recordings, of several controller gains.
    base : ServoFit
    progress : callable
        Told in a few words what is under way.
    """
    for number in range(1, MOST_ROUNDS + 1):
        tried = []
        for name, points in candidates(base.values).items():
            progress(f"round {number}: {name.replace('_', ' ')}")
            fits = [fit(runs, {**base.values, **point}, 0) for point in points]
            lowest = min(fits, key=lambda f: f.error)
            tried.append(LawTrial(name, lowest, 1 - (lowest.error / base.error) ** 2))
        tried.sort(key=lambda t: -t.explained)
        if tried and tried[0].explained > WORTH:
            progress(f"round {number}: leaving out one controller gain after another")
            before = _left_out(runs, base)
            for k, t in enumerate(tried[:MOST_LEFT_OUT]):
                if t.explained > WORTH:
                    progress(f"round {number}: the same with {t.name.replace('_', ' ')}")
                    tried[k] = _judged(runs, base, t, before)
        named = best(tried)
        if named:
            progress(f"round {number}: {named.name.replace('_', ' ')}, fitted to the end")
            base = fit(runs, named.fit.values, EVALUATIONS)
            named = replace(named, fit=base)
        yield Round(tuple(tried), named)
        if named is None:
            return


def best(tried: Sequence[LawTrial]) -> LawTrial | None:
    """The candidate to name: of those that pass, the best score; of scores as good as equal, the fewest parameters."""
    passing = [t for t in tried if t.passes]
    likely = [t for t in passing if t.score > max(p.score for p in passing) - TIE]
    return min(likely, key=lambda t: (len(t.fit.values), -t.score), default=None)


def _left_out(runs: Sequence[ServoRun], model: ServoFit) -> dict[float, float]:
    """RMS position error of each gain's recordings, the model fitted to the other gains [rad]."""
    found = {}
    for gain in sorted({r.gain for r in runs}):
        seen, unseen = [r for r in runs if r.gain != gain], [r for r in runs if r.gain == gain]
        found[gain] = rms(unseen, fit(seen, model.values, FEWER).values)
    return found


def _judged(runs: Sequence[ServoRun], base: ServoFit, tried: LawTrial, before: Mapping[float, float]) -> LawTrial:
    """Predicted shares, and the score: each gain's error has a variance of its own."""
    after = _left_out(runs, tried.fit)
    seconds = {gain: sum(float(np.ptp(r.time)) for r in runs if r.gain == gain) for gain in before}
    gained = sum(seconds[gain] / CLUSTER * np.log(before[gain] / after[gain]) for gain in before)
    added = len(tried.fit.values) - len(base.values)
    score = float(gained - 0.5 * added * np.log(sum(seconds.values()) / CLUSTER))
    return replace(tried, forecast={gain: 1 - (after[gain] / before[gain]) ** 2 for gain in before}, score=score)


def _errors(runs: Sequence[ServoRun], values: Values) -> Array:
    return np.concatenate([simulate(r, values) - r.position for r in runs])


def _is_shape(name: str) -> bool:
    effect, _, own = name.partition(".")
    return bool(own) and any(p.name == own and p.grid for p in effects()[effect].parameters)


def _low(name: str) -> float:
    """Lower bound; a shape's is a tenth of its usual size, since the vocabulary's are relative to a joint's scales."""
    effect, _, own = name.partition(".")
    if _is_shape(name):
        return 0.1
    if not own:
        return -np.inf if name == "zero" else 1e-6
    return next(p.low for p in effects()[effect].parameters if p.name == own)


def evolve(cost: Callable[[Array], float], start: Array, low: Array, evaluations: int, seed: int) -> Array:
    """Minimise without slopes: CMA-ES with its usual settings (Hansen 2016), points below ``low`` taken back."""
    rng = np.random.default_rng(seed)
    n = len(start)
    count = 4 + int(3 * np.log(n))
    weight = np.log(count // 2 + 0.5) - np.log(np.arange(1, count // 2 + 1))
    weight /= weight.sum()
    mass = 1 / np.sum(weight**2)
    rate_sigma = (mass + 2) / (n + mass + 5)
    damping = 1 + 2 * max(0.0, np.sqrt((mass - 1) / (n + 1)) - 1) + rate_sigma
    rate_path = (4 + mass / n) / (n + 4 + 2 * mass / n)
    rate_one = 2 / ((n + 1.3) ** 2 + mass)
    rate_many = min(1 - rate_one, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
    usual = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))
    mean, sigma, matrix = start.copy(), 0.1, np.eye(n)
    path, path_sigma = np.zeros(n), np.zeros(n)
    best, best_cost = start, cost(start)
    for generation in range(1, evaluations // count + 1):
        spread, axes = np.linalg.eigh(matrix)
        spread = np.sqrt(np.maximum(spread, 1e-20))
        steps = (rng.standard_normal((count, n)) * spread) @ axes.T
        points = np.maximum(mean + sigma * steps, low)
        outside = np.sum((mean + sigma * steps - points) ** 2, axis=1)
        values = np.array([cost(p) for p in points])
        order = np.argsort(values + 1e-3 * outside)
        if values[order[0]] < best_cost:
            best, best_cost = points[order[0]], values[order[0]]
        chosen = steps[order[: len(weight)]]
        move = weight @ chosen
        mean = mean + sigma * move
        whitened = axes @ ((axes.T @ move) / spread)
        path_sigma = (1 - rate_sigma) * path_sigma + np.sqrt(rate_sigma * (2 - rate_sigma) * mass) * whitened
        length = np.linalg.norm(path_sigma)
        steady = length / np.sqrt(1 - (1 - rate_sigma) ** (2 * generation)) < (1.4 + 2 / (n + 1)) * usual
        path = (1 - rate_path) * path + steady * np.sqrt(rate_path * (2 - rate_path) * mass) * move
        matrix = (1 - rate_one - rate_many) * matrix + rate_one * np.outer(path, path)
        matrix += rate_many * np.einsum("i,ij,ik->jk", weight, chosen, chosen)
        sigma *= np.exp(rate_sigma / damping * (length / usual - 1))
    return best
