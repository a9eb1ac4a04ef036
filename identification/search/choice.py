"""The choice among what passes: the best candidate for every channel, and how often each beats its rivals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.model import Placed
from .evidence import ABSORBED
from .judged import Judged
from .passing import ALIKE, seen_near_rest
from .screening import Screening

AS_GOOD = 0.1
"""Difference of two scores in a bootstrap that is none: twins explain the same to the last digits."""

AHEAD = 1.15
"""Ratio of scores up to which a special case is preferred to what contains it."""

BOOTSTRAPS = 400


@dataclass(frozen=True)
class RivalOdds:
    """A rival of an effect: how often it won the bootstrap, and whether these recordings can tell the two apart."""

    placed: Placed
    probability: float
    separable: bool


@dataclass(frozen=True)
class Taken:
    """An effect that the search took, with how often it beat every rival in a bootstrap over time blocks, and the
    log-likelihood that it gained in blocks left out, together with what has become part of it."""

    judged: Judged
    probability: float
    rivals: tuple[RivalOdds, ...]
    gained: float


def is_all(wide: Judged, other: Judged) -> bool:
    """Is an effect all that another one at its place is, and more? Levels of friction add up instead."""
    effect = wide.placed.effect
    contained = wide.placed.at == other.placed.at and other.placed.effect.name in effect.contains
    return contained and effect.family != "joint friction"


def widest(new: Judged, taken: Sequence[Taken]) -> Judged | None:
    """A candidate, or what was taken before if it is all that; with every parameter free. None where it is already."""
    for old in (t.judged for t in taken):
        for wide, part in ((new, old), (old, new)):
            if is_all(wide, part):
                if wide is old and not old.placed.hold:
                    return None
                return replace(wide, placed=replace(wide.placed, hold=()))
    return new


def choose(result: Screening, passing: Sequence[Judged]) -> list[Judged]:
    """The best candidate, and beside it the best on every channel that no better candidate reaches."""
    scores = {j.placed.key: j.score for j in passing}
    best: dict[int, Judged] = {}
    for j in passing:
        if len(j.channels) == 1:
            best.setdefault(j.channels[0], j)
    chosen: list[Judged] = []
    reached: set[int] = set()
    for j in passing:
        special = [scores.get(f"{name}.{j.placed.at}", -np.inf) for name in j.placed.effect.contains]
        if j.score < AHEAD * max(special, default=-np.inf):
            continue  # a special case of it passes too, explains nearly as much, and goes first
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


def weigh(result: Screening, best: Judged, passing: Sequence[Judged], seed: int) -> Taken:
    """Bootstrap over time blocks: how often does each candidate on these channels beat all others?"""
    evidence = result.evidence

    def contradicts(j: Judged) -> bool:
        """What contains the effect as a special case does not; of a link's mass, it may be the whole truth."""
        if best.placed.effect.name not in j.placed.effect.contains or best.placed.at != j.placed.at:
            return True
        return best.placed.effect.at == "link" and evidence.likeness(best.signal(), j.signal()) > ALIKE

    rivals = [best] + [
        j
        for j in passing
        if j is not best and set(j.channels) & set(best.channels) and j.score > 0.2 * best.score and contradicts(j)
    ]
    rivals = rivals[:8]
    near_rest = any(seen_near_rest(result, j) for j in rivals)
    alike = [j.among(result.near_rest) if near_rest else j for j in rivals]
    # As in the choice: what has more freedom must explain plainly more, at whatever link.
    wide = [best.placed.effect.at == "link" and best.placed.effect.name in j.placed.effect.contains for j in rivals]
    gains = np.array([j.case.shares() / (AHEAD if w else 1.0) for j, w in zip(alike, wide, strict=True)])
    price = np.array([j.price for j in rivals])
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(evidence.n_blocks, np.full(evidence.n_blocks, 1 / evidence.n_blocks), BOOTSTRAPS)
    scores = counts @ gains.T - price
    # Those as good as the best share a win; and half a win more than seen for each: no bootstrap makes certain.
    winners = scores > scores.max(axis=1, keepdims=True) - AS_GOOD
    wins = (np.sum(winners / winners.sum(axis=1, keepdims=True), axis=0) + 0.5) / (BOOTSTRAPS + 0.5 * len(rivals))
    others = [
        RivalOdds(j.placed, float(w), bool(w < 0.05 and evidence.likeness(best.signal(), j.signal()) < ALIKE))
        for j, w in zip(rivals[1:], wins[1:], strict=True)
    ]
    others.sort(key=lambda r: -r.probability)
    return Taken(best, float(wins[0]), tuple(others[:4]), float(best.case.fresh_gains().sum()))
