"""Forward search: which effects, at which places, the recordings ask for; one joint refit after every round.

A candidate is judged on whitened samples with the whole baseline fitted again beside it. It is taken when

1. its score (log-likelihood gained less ½ log(samples) for each parameter) beats the best score that *any* candidate
      on the same channels reaches on noise alone (over sign-flipped nulls, the 99.5 % quantile of the maximum);
2. fitted without a time block, it predicts that block better than the baseline, over all blocks;
3. it explains a share of its channels' residual energy that is worth a name.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models.model import Model, Placed
from .assembly import Assembly
from .base_parameters import BaseParameters
from .closed_loop import planned
from .evidence import ABSORBED
from .experiment import Experiment, Scales
from .fit import Fit, fit
from .rig_terms import PLACES
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
    before: Found | None = None,
    barred: Collection[str] = (),
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
    before : Found, optional
        An earlier search of the same: its baseline and first screening are not done again.
    barred : collection of str
        Keys of effects and places that must not be taken.
    progress : callable
        Told in a few words what is under way.
    seed : int
    """
    taken: list[Taken] = []
    if before is None:
        progress("fitting the baseline")
        first = found = fit(assemble(model, base, scales), experiments, progress=progress, seed=seed)
        progress("round 1: screening every effect at every place")
        instruments = planned(found, experiments)
        opening = result = screen(model, found, experiments, instruments, None, seed)
    else:
        first = found = before.first
        opening = result = before.opening
        instruments = before.instruments
    for number in range(2, MOST_ROUNDS + 2):
        passing = [j for j in _passing(result) if j.placed.key not in barred]
        chosen = _choose(result, passing)
        if not chosen:
            break
        taken += [_weigh(result, j, passing, seed) for j in chosen]
        start = {key: value for j in chosen for key, value in j.start().items()}
        model = model.with_effects([j.placed for j in chosen], start)
        progress("refitting with " + ", ".join(f"{j.placed.effect.name} at {j.placed.at}" for j in chosen))
        assembly = assemble(model, base, scales)
        found = fit(assembly, experiments, start=carry(found, assembly), multi_start=False)
        progress(f"round {number}: screening every effect at every place")
        instruments = planned(found, experiments, instruments)
        result = screen(model, found, experiments, instruments, opening.noise, seed)
    return Found(first, model, found, tuple(taken), opening, result, tuple(instruments))


def carry(found: Fit, assembly: Assembly) -> Array:
    """A fit's parameters in another assembly's order; what is new there starts where that assembly says."""
    known = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    return np.array([known.get(s.key, s.start) for s in assembly.slots])


def without(found: Fit, placed: Placed) -> Assembly:
    """The same model with one effect taken out again."""
    return found.assembly.keep([p for p in found.assembly.placed if p.key != placed.key], found.theta)


def _passing(result: Screening) -> list[Judged]:
    """Candidates that pass every test, best first."""
    passing = []
    for j in result.judged:
        if j.score <= result.threshold[j.channels] or j.explained < WORTH:
            continue
        fresh = result.evidence.fresh_gains(j.products, j.variant.low, j.variant.high)
        if reliably_positive(fresh) and _holds_in_motion(result, j):
            passing.append(j)
    return passing


def _choose(result: Screening, passing: Sequence[Judged]) -> list[Judged]:
    """The best candidate, and beside it the best on every channel that no better candidate reaches."""
    keys = {j.placed.key for j in passing}
    best: dict[int, Judged] = {}
    for j in passing:
        if len(j.channels) == 1:
            best.setdefault(j.channels[0], j)
    chosen: list[Judged] = []
    reached: set[int] = set()
    for j in passing:
        if any(f"{name}.{j.placed.at}" in keys for name in j.placed.effect.contains):
            continue  # a special case of it passes too, and goes first
        local = [best[c] for c in j.channels if c in best]
        if len(j.channels) > 1 and local and not _worth_its_reach(result, j, local):
            continue
        if reached.isdisjoint(j.channels):
            chosen.append(j)
        reached |= set(j.channels)
    return chosen


def _worth_its_reach(result: Screening, wide: Judged, local: Sequence[Judged]) -> bool:
    """Is an effect that reaches several channels, with the local ones it leaves a need for, a better story than the
    best local effects of those channels together?"""
    alone = _together(result, [wide])
    beside = [j for j in local if _together(result, [wide, j]) - alone > result.threshold[j.channels]]
    return _together(result, [wide, *beside]) >= _together(result, local)


def _together(result: Screening, several: Sequence[Judged]) -> float:
    """Score of several candidates at once."""
    reached = sorted({c for j in several for c in j.channels})
    size = {c: len(result.evidence.channels[c].residual) for c in reached}
    columns = [
        (c, np.hstack([j.columns.get(c, np.zeros((size[c], len(j.variant.low)))) for j in several])) for c in reached
    ]
    low, high = (np.concatenate([getattr(j.variant, side) for j in several]) for side in ("low", "high"))
    gain = result.evidence.gain(result.evidence.products(columns), low, high, ABSORBED)
    return gain.total - sum(j.price for j in several)


def _holds_in_motion(result: Screening, j: Judged) -> bool:
    """Does it still pass with the samples near rest left out? Stuck friction poses as delay, elasticity and
    Stribeck."""
    if j.placed.effect.at_rest or j.placed.effect.at in (*PLACES, "base"):
        return True  # what a sling does shows on joints that stand still while others move
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
