"""What a capture's model leaves out, by simulation in the loop: forward search over the effects that a snare can have.

Each candidate is tried at a few values beside what the model has; the likelihood that this would reach, once the
model's own parameters have moved, is foreseen from their derivatives. The best few are fitted together with everything
else. A candidate is named when the likelihood gained, less ½ ln(numbers) for its parameter, beats what the best of all
reaches by chance once in 200 diagnoses, when it explains a share worth a name, and when a capture that the fit never
saw is told better with it.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.model import Model, Placed
from .least_squares import Normal, bounded_step
from .search import ALIKE, BOOTSTRAPS
from .snare_fit import (
    HANDLES,
    NEWS,
    Fit,
    bounds,
    evaluate,
    fit,
    normal,
    scales,
    started,
    values_of,
    with_slopes,
)
from .snare_library import absent, library, start_of
from .snare_recording import Capture
from .snare_runs import Runs, tracks_at

Array = NDArray[np.float64]

CHANCE = 0.005
"""How often the best of all candidates may beat the bar by chance."""
EXPLAINED = 0.2
"""Share of the weighted residual energy that a name must explain: engines differ by some of it."""
FITTED = 3
"""Candidates of a round that are fitted."""
ROUNDS = 4
CONFIRMED = 1.0
"""Least gain of the likelihood on the held-out capture."""
HOPE = 2.0
"""A candidate that is foreseen to lose more of the likelihood is not fitted."""
STRETCH = 4
"""Numbers (1 s) in a time block of the bootstrap."""


@dataclass(frozen=True)
class Trial:
    """A candidate beside what was there: the fit, its score, the share that it explains, and whether it passes."""

    placed: Placed
    fit: Fit
    score: float
    explained: float
    passes: bool


@dataclass(frozen=True)
class Named:
    """An effect taken: its trial, how often it beat its rivals, and these: how often each won, and whether the
    recordings tell it apart; the fits before and after, and how the held-out captures are told by both."""

    trial: Trial
    margin: float
    rivals: tuple[tuple[Placed, float, bool], ...]
    before: Fit
    held_before: Fit
    held_after: Fit


@dataclass(frozen=True)
class Searched:
    """What was named; the fits as the model came, and at the end; the same evaluated on the held-out captures; what the
    first round made of every candidate, and which passed without being confirmed."""

    named: tuple[Named, ...]
    first: Fit
    last: Fit
    held_first: Fit
    held_last: Fit
    opening: tuple[Trial, ...]
    rejected: tuple[Placed, ...]
    bar: float


def search(
    model: Model,
    runs: Runs,
    captures: Sequence[Capture],
    train: Sequence[int],
    locked: Sequence[int],
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Searched:
    """Add effects to a capture's model until no candidate is left that passes and is confirmed.

    Parameters
    ----------
    model : Model
    runs : Runs
        Of the captures.
    captures : sequence of Capture
    train, locked : sequences of int
        Captures that are fitted and searched, and those held out.
    progress : callable
    seed : int
        Of the bootstrap.
    """
    progress(f"simulating {len(train)} captures with the model as given, and fitting its parameters")
    start = started(runs, captures, train, model.effects, start_of(model, model.effects))
    demand(model, start)
    first = found = fit(runs, captures, train, start)
    held_first = held = _held(runs, captures, locked, found)
    pool, named, rejected = library(model), [], {}
    own = [captures[n] for n in train]
    count = sum(n for n, _ in scales(own, first.residuals).values()) * NEWS
    bar = float(np.log(max(len(pool), 1) / CHANCE))
    opening: tuple[Trial, ...] = ()
    for number in range(ROUNDS):
        have = {p.effect.name for p in found.placed}
        left = [p for p in pool if p.effect.name not in have]
        if not left:
            break
        trials = _round(model, runs, captures, train, found, left, 0.5 * np.log(count), bar, rejected, progress)
        opening = opening if number else trials
        taken = None
        passing = sorted((t for t in trials if t.passes and t.placed.key not in rejected), key=lambda t: -t.score)
        for trial in passing:
            progress(f"confirming {trial.placed.effect.name} on the held-out capture")
            there = _held(runs, captures, locked, trial.fit)
            if there.likelihood > held.likelihood + CONFIRMED:
                taken = (trial, there)
                break
            rejected[trial.placed.key] = trial.placed
        if taken is None:
            break
        trial, there = taken
        rivals = [t for t in trials if t is not trial and t.score > 0.2 * trial.score]
        named.append(_weigh(own, trial, rivals, found, held, there, seed))
        found, held = trial.fit, there
    found = with_slopes(runs, captures, train, found)
    gone = tuple(p for key, p in rejected.items() if key not in {n.trial.placed.key for n in named})
    return Searched(tuple(named), first, found, held_first, held, opening, gone, bar)


def _held(runs: Runs, captures: Sequence[Capture], locked: Sequence[int], found: Fit) -> Fit:
    """A fit's parameters on the held-out captures."""
    return evaluate(runs, captures, locked, found.placed, [found.x])[0]


def _round(
    model: Model,
    runs: Runs,
    captures: Sequence[Capture],
    train: Sequence[int],
    found: Fit,
    left: Sequence[Placed],
    price: float,
    bar: float,
    rejected: Collection[str],
    progress: Callable[[str], None],
) -> tuple[Trial, ...]:
    """Try all candidates, fit the best few, judge them."""
    own = [captures[n] for n in train]
    if found.slopes is None:
        found = with_slopes(runs, captures, train, found)
    many = [(p, HANDLES[p.effect.name].x(v)) for p in left for v in HANDLES[p.effect.name].tries]
    progress(f"trying {len(left)} effects at {len(many)} values in simulation")
    # All are asked for at once, so that the processes share them; what was run is remembered.
    tracks_at(runs, train, [values_of((*found.placed, p), np.append(found.x, x)) for p, x in many])
    tried: list[tuple[float, Placed, Fit]] = []
    for p in left:
        mine = [np.append(found.x, x) for q, x in many if q.key == p.key]
        there = evaluate(runs, captures, train, (*found.placed, p), mine)
        tried += [(_foreseen(own, found, f)[0], p, f) for f in there]
    best: dict[str, tuple[float, Placed, Fit]] = {}
    for entry in tried:
        if entry[1].key not in best or entry[0] > best[entry[1].key][0]:
            best[entry[1].key] = entry
    order = sorted(best.values(), key=lambda e: -e[0])
    trials = []
    for rank, (foreseen, p, there) in enumerate(order):
        worth = there
        hopeful = foreseen > found.likelihood - HOPE
        if rank < FITTED and hopeful and p.key not in rejected and np.isfinite(there.likelihood):
            progress(f"fitting {p.effect.name} at {p.at} together with what is there")
            own_tries = [f for _, q, f in tried if q.key == p.key and f.residuals]
            worth = _joint(runs, captures, train, found, own_tries, absent(model, p))
        score = float(worth.likelihood - found.likelihood - price)
        explained = _explained(own, found, worth)
        trials.append(Trial(p, worth, score, explained, score > bar and explained > EXPLAINED))
    return tuple(trials)


def _joint(
    runs: Runs, captures: Sequence[Capture], train: Sequence[int], found: Fit, tried: Sequence[Fit], nothing: float
) -> Fit:
    """Fit a candidate with everything, from the best of its tries and of four more on either side of that.

    Its first derivative is the secant to the nearest of them: likelihood has more than one top over it, where forces
    swing in and out of step.
    """
    assert found.slopes is not None
    own, placed = [captures[n] for n in train], tried[0].placed
    best = max(tried, key=lambda f: _foreseen(own, found, f)[0])
    x = float(best.x[-1])
    known = sorted({nothing, *(float(f.x[-1]) for f in tried)})
    below = max((k for k in known if k < x), default=x - (known[-1] - known[0]))
    above = min((k for k in known if k > x), default=x + (x - below))
    low, high = bounds(placed)
    between = [x + share * (end - x) for end in (below, above) for share in (1 / 3, 2 / 3)]
    more = [np.append(found.x, b) for b in between if low[-1] < b < high[-1]]
    every = [f for f in (*tried, *evaluate(runs, captures, train, placed, more)) if f.residuals]
    best = max(every, key=lambda f: _foreseen(own, found, f)[0])
    other = min((f for f in every if f is not best), key=lambda f: abs(f.x[-1] - best.x[-1]), default=found)
    gap = float(best.x[-1] - (nothing if other is found else other.x[-1]))
    last = tuple(
        {name: (a[name] - b[name]) / gap for name in a} for a, b in zip(best.residuals, other.residuals, strict=True)
    )
    here = replace(best, slopes=(*found.slopes, last))
    _, moved = _foreseen(own, found, best)
    if np.any(moved != found.x):
        (start,) = evaluate(runs, captures, train, placed, [np.append(moved, best.x[-1])])
        here = replace(start, slopes=here.slopes) if start.likelihood > best.likelihood else here
    return fit(runs, captures, train, here)


def demand(model: Model, found: Fit) -> None:
    """Refuse a capture that cannot be simulated at all."""
    if not np.isfinite(found.likelihood):
        raise InputError(
            f"{model.path}: the capture cannot be simulated from where the recording starts (the pin inside a cable, "
            "or steps that do not converge); check [capture] against the test's set-up"
        )


def _foreseen(captures: Sequence[Capture], found: Fit, there: Fit) -> tuple[float, Array]:
    """L of a try once the parameters that were there move as their derivatives allow, and where they then stand."""
    if not np.isfinite(there.likelihood) or not len(found.x):
        return there.likelihood, found.x
    seen = replace(there, x=found.x, placed=found.placed, slopes=found.slopes)
    gradient, matrix = normal(captures, seen)
    low, high = bounds(found.placed)
    free = np.array([not p.hold for p in found.placed], bool)
    size = np.where(free, np.sqrt(np.diag(matrix)), 0.0)
    stride = np.array([4 * HANDLES[p.effect.name].step for p in found.placed])
    here = Normal(0.0, gradient, matrix)
    move = bounded_step(here, size, 1e-2, np.maximum(low - found.x, -stride), np.minimum(high - found.x, stride))
    gain = -(gradient @ move + 0.5 * move @ matrix @ move)
    return float(there.likelihood + gain), found.x + move


def _energy(captures: Sequence[Capture], residuals: Sequence[Mapping[str, Array]], by: Mapping[str, float]) -> float:
    return float(sum(np.sum(r[name] ** 2) / by[name] for r in residuals for name in r))


def _explained(captures: Sequence[Capture], found: Fit, there: Fit) -> float:
    """Share of the residual energy that is gone, each block by its own scale before."""
    if not there.residuals:
        return 0.0
    by = {name: v for name, (_, v) in scales(captures, found.residuals).items()}
    return 1 - _energy(captures, there.residuals, by) / _energy(captures, found.residuals, by)


def _weigh(
    captures: Sequence[Capture], best: Trial, others: Sequence[Trial], before: Fit, held: Fit, there: Fit, seed: int
) -> Named:
    """Bootstrap over time blocks of 1 s: how often does each candidate beat all others?"""
    by = {name: v / NEWS for name, (_, v) in scales(captures, best.fit.residuals).items()}
    rivals = [best, *others]
    gains = np.array([_by_time(before.residuals, by) - _by_time(t.fit.residuals, by) for t in rivals])
    rng = np.random.default_rng(seed)
    n = gains.shape[1]
    winners = np.argmax(rng.multinomial(n, np.full(n, 1 / n), BOOTSTRAPS) @ gains.T, axis=1)
    wins = (np.bincount(winners, minlength=len(rivals)) + 0.5) / (BOOTSTRAPS + 0.5 * len(rivals))
    signals = [_signal(before, t.fit, by) for t in rivals]
    found = []
    for t, w, s in zip(others, wins[1:], signals[1:], strict=True):
        alike = float(signals[0] @ s) / max(float(np.linalg.norm(signals[0]) * np.linalg.norm(s)), 1e-300)
        found.append((t.placed, float(w), bool(w < 0.05 and alike < ALIKE)))
    return Named(best, float(wins[0]), tuple(sorted(found, key=lambda x: -x[1])), before, held, there)


def _by_time(residuals: Sequence[Mapping[str, Array]], by: Mapping[str, float]) -> Array:
    """½ weighted residual energy of every second of every capture."""
    found = []
    for own in residuals:
        length = max(len(r) * (1 if not name.startswith("chatter") else 2) for name, r in own.items())
        energy = np.zeros(-(-length // STRETCH))
        for name, r in own.items():
            each = 0.5 * np.sum(r**2, axis=1) / by[name]
            stretch = STRETCH // 2 if name.startswith("chatter") else STRETCH
            energy += np.bincount(np.minimum(np.arange(len(each)) // stretch, len(energy) - 1), each, len(energy))
        found.append(energy)
    return np.concatenate(found)


def _signal(before: Fit, after: Fit, by: Mapping[str, float]) -> Array:
    """What a candidate changes, whitened by the scales, end to end."""
    pairs = zip(before.residuals, after.residuals, strict=True)
    return np.concatenate([((a[name] - b[name]) / by[name] ** 0.5).ravel() for a, b in pairs for name in a])
