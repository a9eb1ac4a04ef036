"""Forward search: which effects, at which places, the recordings ask for; one joint refit after every round.

A candidate is judged on whitened samples with the whole baseline fitted again beside it. It is taken when

1. its score (log-likelihood gained less ½ log(samples) for each parameter) beats the best score that *any* candidate
      on the same channels reaches on noise alone (over sign-flipped nulls, the 99.5 % quantile of the maximum);
2. fitted without a time block, it predicts that block better than the baseline, over all blocks;
3. it explains a share of its channels' residual energy that is worth a name.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models.model_file import Model, Placed
from .assembly import Assembly
from .base_parameters import BaseParameters
from .closed_loop import planned
from .experiment import Experiment, Scales
from .fit import Fit, fit
from .saturated import Noise
from .screening import WORTH, Judged, Screening, reliably_positive, screen

Array = NDArray[np.float64]

ALIKE = 0.98
"""Cosine from which on two effects explain the same."""

MOST_ROUNDS = 8
BOOTSTRAPS = 400


@dataclass(frozen=True)
class RivalOdds:
    """A rival of an effect: how often it won the bootstrap, and whether these recordings can tell the two apart."""

    placed: Placed
    probability: float
    separable: bool


@dataclass(frozen=True)
class Taken:
    """An effect that the search took, with how often it beat every rival in a bootstrap over time blocks."""

    judged: Judged
    probability: float
    rivals: tuple[RivalOdds, ...]


@dataclass(frozen=True)
class Found:
    """Baseline fit, model with all that was taken and its fit, first and last screening."""

    first: Fit
    model: Model
    fit: Fit
    taken: tuple[Taken, ...]
    opening: Screening
    closing: Screening
    instruments: tuple[Experiment, ...]


def assemble(model: Model, base: BaseParameters | None, scales: Mapping[str, Scales]) -> Assembly:
    """Parameters and torque of a model, started from the values it has."""
    return Assembly(model.tree, model.effects, base, scales, model.values)


def search(
    model: Model,
    base: BaseParameters | None,
    scales: Mapping[str, Scales],
    experiments: Sequence[Experiment],
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Found:
    """Add effects to a model until no candidate is left that passes.

    Parameters
    ----------
    model : Model
        Baseline.
    base : BaseParameters or None
        With ``inertia = "free"``.
    scales : mapping of str to Scales
    experiments : sequence of Experiment
        Training recordings.
    progress : callable
        Told in a few words what is under way.
    seed : int
    """
    progress("fitting the baseline")
    first = found = fit(assemble(model, base, scales), experiments, progress=progress, seed=seed)
    instruments = None
    taken: list[Taken] = []
    opening: Screening | None = None
    noise: Noise | None = None
    for number in range(1, MOST_ROUNDS + 2):
        progress(f"round {number}: screening every effect at every place")
        instruments = planned(found, experiments, instruments)
        result = screen(model, found, experiments, instruments, noise, seed)
        opening, noise = opening or result, result.noise
        passing = _passing(result) if number <= MOST_ROUNDS else []
        chosen = _choose(passing)
        if not chosen:
            break
        taken += [_weigh(result, j, passing, seed) for j in chosen]
        start = {key: value for j in chosen for key, value in j.start().items()}
        model = model.with_effects([j.placed for j in chosen], start)
        progress("refitting with " + ", ".join(f"{j.placed.effect.name} at {j.placed.at}" for j in chosen))
        assembly = assemble(model, base, scales)
        found = fit(assembly, experiments, start=carry(found, assembly), multi_start=False)
    assert opening is not None
    return Found(first, model, found, tuple(taken), opening, result, tuple(instruments or ()))


def carry(found: Fit, assembly: Assembly) -> Array:
    """A fit's parameters in another assembly's order; what is new there starts where that assembly says."""
    known = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    return np.array([known.get(s.key, s.start) for s in assembly.slots])


def without(found: Fit, placed: Placed) -> Assembly:
    """The same model with one effect taken out again."""
    old = found.assembly
    rest = [p for p in old.placed if p.key != placed.key]
    return Assembly(old.tree, rest, old.base, old.scales, old.values(found.theta))


def _passing(result: Screening) -> list[Judged]:
    """Candidates that pass every test, best first."""
    passing = []
    for j in result.judged:
        if j.score <= result.threshold[j.channels] or j.explained < WORTH:
            continue
        fresh = result.evidence.fresh_gains(j.products, j.variant.low, j.variant.high)
        if reliably_positive(fresh) and _holds_in_motion(result, j):
            passing.append(j)
    single: dict[int, float] = {}
    for j in passing:
        if len(j.channels) == 1:
            single.setdefault(j.channels[0], j.score)
    # Where several local effects explain more than one that reaches everywhere, they are the simpler story.
    return [j for j in passing if len(j.channels) == 1 or sum(single.get(c, 0.0) for c in j.channels) <= j.score]


def _choose(passing: Sequence[Judged]) -> list[Judged]:
    """The best candidate, and beside it the best on every channel that no better candidate reaches."""
    keys = {j.placed.key for j in passing}
    chosen: list[Judged] = []
    reached: set[int] = set()
    for j in passing:
        if any(f"{name}.{j.placed.at}" in keys for name in j.placed.effect.contains):
            continue  # a special case of it passes too, and goes first
        if reached.isdisjoint(j.channels):
            chosen.append(j)
        reached |= set(j.channels)
    return chosen


def _holds_in_motion(result: Screening, j: Judged) -> bool:
    """Does it still pass with the samples near rest left out? Stuck friction poses as delay, elasticity and
    Stribeck."""
    if j.placed.effect.at_rest:
        return True
    moving = result.moving
    products = moving.products([(c, x[~result.at_rest[c]]) for c, x in j.columns.items()])
    gain = moving.gain(products, j.variant.low, j.variant.high)
    energy = sum(float(np.sum(moving.channels[c].residual ** 2)) for c in j.channels)
    fresh = moving.fresh_gains(products, j.variant.low, j.variant.high)
    enough = gain.total - j.price > result.threshold[j.channels] and 2 * gain.total > WORTH * energy
    return enough and reliably_positive(fresh, 1.0)


def _weigh(result: Screening, best: Judged, passing: Sequence[Judged], seed: int) -> Taken:
    """Bootstrap over time blocks: how often does each candidate on these channels beat all others?"""
    evidence = result.evidence
    # What contains the effect as a special case does not contradict it.
    rivals = [best] + [
        j
        for j in passing
        if j is not best
        and best.placed.effect.name not in j.placed.effect.contains
        and set(j.channels) & set(best.channels)
        and j.score > 0.2 * best.score
    ]
    rivals = rivals[:8]
    gains = np.array([evidence.shares(j.products, j.amplitudes) for j in rivals])
    price = np.array([j.price for j in rivals])
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(evidence.n_blocks, np.full(evidence.n_blocks, 1 / evidence.n_blocks), BOOTSTRAPS)
    winners = np.argmax(counts @ gains.T - price, axis=1)
    # Half a win more than seen for each: no bootstrap is evidence of certainty.
    wins = (np.bincount(winners, minlength=len(rivals)) + 0.5) / (BOOTSTRAPS + 0.5 * len(rivals))
    others = [
        RivalOdds(j.placed, float(w), bool(w < 0.05 and evidence.likeness(best.signal(), j.signal()) < ALIKE))
        for j, w in zip(rivals[1:], wins[1:], strict=True)
    ]
    others.sort(key=lambda r: -r.probability)
    return Taken(best, float(wins[0]), tuple(others[:4]))
