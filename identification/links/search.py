"""What motor and link encoder of a joint differ by, named: forward search over a handful of effects.

Every candidate is fitted together with all that was named before it and with each recording's zero, on samples
whitened by the noise that the saturated model leaves. It is named when its score (log-likelihood gained less
½ log(samples) for each parameter) beats what the best of all candidates reaches by chance once in 200 diagnoses, when,
fitted without a time block, it predicts that block better, and when it explains a share worth a name.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from ...models.effects import effects
from ...models.model import Placed
from ..deciding import ALIKE, BLOCK
from ..reliability import BOOTSTRAPS
from ..search.candidates import MOST_VARIANTS
from ..search.noise import Whitener, whitener
from .pair import Pair, PairFit, fit_pair

Array = NDArray[np.float64]

AT_LINK = ("sensor_delay", "sensor_gain", "sensor_drift")
AT_JOINT = ("joint_elasticity", "backlash")

WORTH = 0.05
"""Least share of the difference's energy that an effect must explain to be named."""

MOST_ROUNDS = 8

MOST_BLOCKS = 24

CHANCE = 0.005
"""How often the best of all candidates may beat the bar by chance; for one candidate the log-likelihood gained by
chance exceeds g with a probability below exp(-g)."""


@dataclass(frozen=True)
class Trial:
    """A candidate with all named before it, fitted on whitened samples; what it gained on each block, its score, and
    the share of the plain difference it explains."""

    placed: Placed
    fit: PairFit
    gains: Array
    price: float
    score: float
    explained: float
    passes: bool


@dataclass(frozen=True)
class Named:
    """An effect taken, how often it beat its rivals in a bootstrap over time blocks, and these: how often each won, and
    whether the recordings tell it apart."""

    trial: Trial
    margin: float
    rivals: tuple[tuple[Placed, float, bool], ...]


@dataclass(frozen=True)
class Searched:
    """What was named, the plain fits before and after, and the first round's trials."""

    named: tuple[Named, ...]
    first: PairFit
    fit: PairFit
    opening: tuple[Trial, ...]
    whiten: Whitener
    bar: float


def library(pair: Pair) -> list[Placed]:
    """Every effect that can make the two encoders of a joint differ."""
    at = [("sensor_delay", f"q.{pair.joint}")]
    at += [(name, f"q_link.{pair.joint}") for name in AT_LINK] + [(name, pair.joint) for name in AT_JOINT]
    return [Placed(effects()[name], place) for name, place in at]


def search_pair(
    pair: Pair, given: Sequence[Placed], values: Array, n_joints: int, barred: Collection[str] = (), seed: int = 0
) -> Searched:
    """Add effects to a pair's model until no candidate is left that passes.

    Parameters
    ----------
    pair : Pair
        Of the training recordings.
    given : sequence of Placed
        Effects that the model has already.
    values : array (P,)
        Their parameters to start from.
    n_joints : int
        Joints that are searched in this diagnosis: each is a chance of a false alarm.
    barred : collection of str
        Keys of effects and places that must not be taken.
    seed : int
        Of the bootstrap.
    """
    zeros = np.array([float(np.mean(run.measured)) for run in pair.runs], float)
    pool = [p for p in library(pair) if p.key not in {g.key for g in given}]
    first = found = fit_pair(pair, given, np.concatenate([values, zeros]))
    whiten = _noise(pair, first, pool)
    bar = float(np.log(len(pool) * n_joints / CHANCE))
    white = fit_pair(pair, given, found.theta, whiten)
    named: list[Named] = []
    opening: tuple[Trial, ...] = ()
    for number in range(MOST_ROUNDS):
        have = {p.effect.name for p in found.placed}  # a second delay, of the other encoder, is an alias of the first
        trials = [_trial(pair, p, found, white, whiten, bar) for p in pool if p.effect.name not in have]
        opening = opening if number else tuple(trials)
        passing = sorted((t for t in trials if t.passes and t.placed.key not in barred), key=lambda t: -t.score)
        special = {t.placed.effect.name for t in passing}
        # A special case goes first; the general law then has what is left (marginality: Nelder 1977).
        passing = [t for t in passing if special.isdisjoint(t.placed.effect.contains)]
        if not passing:
            break
        best = passing[0]
        named.append(_weigh(best, passing[1:], white, seed))
        white = best.fit
        found = fit_pair(pair, white.placed, white.theta)
    return Searched(tuple(named), first, found, opening, whiten, bar)


def starts(pair: Pair, placed: Placed) -> list[Array]:
    """Points of the effect's grid to start from."""
    axes = [
        [g * pair.scales.of(p.relative_to) for g in p.grid] or [p.zero * pair.scales.of(p.relative_to)]
        for p in placed.effect.parameters
    ]
    grid = [np.array(g, float) for g in product(*axes)]
    return grid[:: -(-len(grid) // MOST_VARIANTS)]


def _noise(pair: Pair, first: PairFit, pool: Sequence[Placed]) -> Whitener:
    """Noise model of what the saturated model leaves: every candidate, and smooth curves over the motion."""
    columns = [first.jacobian]
    for p in pool:
        options = starts(pair, p)
        columns.append(_signal(pair, p, options[len(options) // 2]))
    columns.append(smooth(pair))
    found, _ = whitener(first.residual, np.concatenate(columns, axis=1), pair.segments)
    return found


def _signal(pair: Pair, placed: Placed, parameters: Array) -> Array:
    """An effect and its derivative in the analysis band (n_band, 1 + p)."""
    parts = []
    for run in pair.runs:
        value, columns = run.term(placed, parameters)
        parts.append(run.motion.to_band(np.concatenate([value[:, None], columns], axis=1)))
    return np.concatenate(parts)


def smooth(pair: Pair, pieces: int = 8) -> Array:
    """Smooth nameless curves (n_band, k): over position, speed, load and time, as hat functions."""
    columns = []
    for name in ("q", "qd", "load", "time"):
        xs = [
            run.load
            if name == "load"
            else run.motion.time - run.motion.time[0]
            if name == "time"
            else getattr(run.motion, name)[:, run.joint]
            for run in pair.runs
        ]
        low, high = min(x.min() for x in xs), max(x.max() for x in xs)
        if high > low:
            knots = np.linspace(low, high, pieces)
            hats = [np.stack([np.interp(x, knots, row) for row in np.eye(pieces)], axis=1) for x in xs]
            columns.append(np.concatenate([run.motion.to_band(h) for run, h in zip(pair.runs, hats, strict=True)]))
    return np.concatenate(columns, axis=1)


def blocks(pair: Pair, lead: int) -> list[slice]:
    """Time blocks of the whitened samples, ``lead`` samples given up at the head of each segment."""
    found, start = [], 0
    for s in pair.segments:
        size = s.stop - s.start - lead
        if size <= 0:
            continue
        most = max(4, MOST_BLOCKS // len(pair.segments))
        pieces = int(np.clip(size / (2 * pair.runs[0].motion.band) / BLOCK, 2, most))
        edges = start + np.arange(pieces + 1) * size // pieces
        found += [slice(int(a), int(b)) for a, b in pairwise(edges) if b > a]
        start += size
    return found


def block_energies(fit: PairFit, parts: Sequence[slice]) -> Array:
    """½ squared residual of every block (B,)."""
    return np.array([0.5 * np.sum(fit.residual[b] ** 2) for b in parts])


def fresh_energies(fit: PairFit, parts: Sequence[slice]) -> Array:
    """The same of a fit to the other blocks (B,), by one Gauss-Newton step from the fit to all."""
    matrix, right = fit.jacobian.T @ fit.jacobian, fit.jacobian.T @ fit.residual
    found = []
    for b in parts:
        own, residual = fit.jacobian[b], fit.residual[b]
        scale = np.sqrt(np.diag(matrix)) + 1e-300
        rest = (matrix - own.T @ own) / np.outer(scale, scale)
        step = np.linalg.pinv(rest, rcond=1e-10, hermitian=True) @ ((right - own.T @ residual) / scale) / scale
        found.append(0.5 * np.sum((residual - own @ step) ** 2))
    return np.array(found)


def _trial(pair: Pair, placed: Placed, found: PairFit, white: PairFit, whiten: Whitener, bar: float) -> Trial:
    """Fit a candidate beside all that is there, from the two best points of its grid, and judge it."""
    grid = starts(pair, placed)
    foreseen = np.array([_foreseen(pair, placed, s, white, whiten) for s in grid])
    least = 0.5 * np.log(len(white.residual))
    cut = blocks(pair, whiten.lead)
    if foreseen.max() - least < bar:
        # Not even with every slope free would it pass: no fit is worth its time.
        return Trial(placed, white, np.zeros(len(cut)), least, float(foreseen.max() - least), 0.0, False)
    count = len(found.theta) - len(pair.runs)
    together = (*found.placed, placed)
    begin = [np.concatenate([found.theta[:count], grid[i], found.theta[count:]]) for i in np.argsort(-foreseen)[:2]]
    best = min((fit_pair(pair, together, s, whiten) for s in begin), key=lambda f: f.energy)
    own = best.parameters(placed)
    moves = np.sum(best.jacobian[:, own] ** 2, axis=0) * best.theta[own] ** 2
    # A parameter without influence where the fit ended (a damping far above the band) is not paid for.
    price = float(least * max(1, np.count_nonzero(moves > 1.0)))
    gains = block_energies(white, cut) - block_energies(best, cut)
    fresh = fresh_energies(white, cut) - fresh_energies(best, cut)
    explained = 1 - fit_pair(pair, together, best.theta).energy / found.energy
    score = float(gains.sum() - price)
    passes = bool(score > bar and explained > WORTH and _holds(fresh))
    return Trial(placed, best, gains, price, score, explained, passes)


def _foreseen(pair: Pair, placed: Placed, start: Array, white: PairFit, whiten: Whitener) -> float:
    """Log-likelihood that a grid point could gain, all parameters moved as their slopes there allow, without bounds."""
    added = whiten(_signal(pair, placed, start), pair.segments)
    residual, columns = white.residual - added[:, 0], np.concatenate([white.jacobian, added[:, 1:]], axis=1)
    scale = np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    left = residual - columns / scale @ np.linalg.lstsq(columns / scale, residual, rcond=1e-10)[0]
    return 0.5 * (white.energy - float(left @ left))


def _holds(fresh: Array) -> bool:
    """Is the gain on blocks left out positive in 97.5 % of bootstraps? A mean's standard error would fail what shows in
    a few blocks only, as a spring does where the load changes."""
    rng = np.random.default_rng(len(fresh))
    sums = rng.multinomial(len(fresh), np.full(len(fresh), 1 / len(fresh)), BOOTSTRAPS) @ fresh
    return float(np.mean(sums > 0)) >= 0.975


def _weigh(best: Trial, passing: Sequence[Trial], white: PairFit, seed: int) -> Named:
    """Bootstrap over time blocks: how often does each candidate beat all others?"""
    rivals = [best, *(t for t in passing if t.score > 0.2 * best.score)]
    gains, price = np.array([t.gains for t in rivals]), np.array([t.price for t in rivals])
    rng = np.random.default_rng(seed)
    n_blocks = gains.shape[1]
    counts = rng.multinomial(n_blocks, np.full(n_blocks, 1 / n_blocks), BOOTSTRAPS)
    winners = np.argmax(counts @ gains.T - price, axis=1)
    # Half a win more than seen for each: no bootstrap is evidence of certainty.
    wins = (np.bincount(winners, minlength=len(rivals)) + 0.5) / (BOOTSTRAPS + 0.5 * len(rivals))
    signal = white.residual - best.fit.residual
    others = []
    for t, w in zip(rivals[1:], wins[1:], strict=True):
        own = white.residual - t.fit.residual
        alike = float(signal @ own) / np.sqrt(float(signal @ signal) * float(own @ own))
        others.append((t.placed, float(w), bool(w < 0.05 and alike < ALIKE)))
    return Named(best, float(wins[0]), tuple(sorted(others, key=lambda x: -x[1])))
