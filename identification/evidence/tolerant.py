"""The search with what the evidence chooses beside it: the masses' tolerance, and each channel's noise."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..deciding import TOLERANCES
from ..nuisance.noise import Noise
from ..nuisance.vibration import vibrating
from .evidence import Evidence
from .members import Members, left_by
from .projected import ProjectedEvidence
from .search import Member, MemberOdds, Search
from .weighed import WeighedRecordings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Best:
    """The best set of a search, its log evidence, and the tolerance of the masses."""

    value: float
    search: Search
    taken: tuple[Member, ...]
    tolerance: float


Searched = tuple[WeighedRecordings, Search, list[MemberOdds], float]
"""Recordings in the noise that was chosen, the search, its best set, and the tolerance of the masses."""


def searched(
    weighed: WeighedRecordings, recordings: Sequence[int], barred: Collection[str], channels: Collection[int]
) -> Searched:
    """The best set of explanations of some recordings, with its noise and its tolerance of the masses.

    Chosen before the search, a wide tolerance would take a payload in; without any, it would be named a payload. So
    with the noise: beside all that could be missing, a torque that wanders is taken for some of it; beside nothing,
    what is missing is taken for a wander. Where something is found, both are tried, and the noise of what it leaves;
    and everywhere that nothing wanders. ``channels`` are those of which that may have changed.
    """
    masses = weighed.beside.tolerant
    tolerances = (*TOLERANCES, *weighed.beside.more) if masses.stop > masses.start else TOLERANCES[:1]
    best = max((_best(weighed, recordings, barred, x) for x in tolerances), key=lambda b: b.value)
    before = weighed
    for c in sorted(channels):
        weighed = _chosen(weighed, c, best, _others(weighed, c, best, recordings), recordings, barred)
    if weighed is not before:
        best = _best(weighed, recordings, barred, best.tolerance)
    return weighed, best.search, best.search.answer(), best.tolerance


def shaken(
    weighed: WeighedRecordings, recordings: Sequence[int], barred: Collection[str], tolerance: float
) -> Searched | None:
    """The best set with what vibrates in the noise; None where nothing does.

    For what is left at the end: before, vibration would stand for what is still to be named, as for a ripple at a
    steady speed, and make the rest of the noise too small."""
    best = _best(weighed, recordings, barred, tolerance)
    before = weighed
    left = left_by(best.search.on, [(t.item, t.size) for t in best.taken], recordings)
    for c in range(len(weighed.noises)):
        own, runs = [x[:, c] for x in left], [weighed.runs[i][c] for i in recordings]
        weighed = _chosen(weighed, c, best, [partial(vibrating, own, runs)], recordings, barred)
    if weighed is before:
        return None
    best = _best(weighed, recordings, barred, tolerance)
    return weighed, best.search, best.search.answer(), best.tolerance


def _chosen(
    weighed: WeighedRecordings,
    c: int,
    best: _Best,
    changes: Sequence[Callable[[Noise], Noise]],
    recordings: Sequence[int],
    barred: Collection[str],
) -> WeighedRecordings:
    """The noise of one channel that is likeliest beside the best set of explanations of that channel by itself."""
    if not changes:
        return weighed
    alone, pool, always = weighed.evidence.alone(c, weighed.pool)
    out = {h for h, x in enumerate(pool) if x.key in barred}
    weight = weighed.beside.weight(best.tolerance)[always]

    def value(evidence: Evidence, noise: Noise) -> float:
        search = Search(ProjectedEvidence(evidence, recordings, weight), pool, out)
        return noise.log_prior + search.on.null + (search.run((), exchange=False)[0] if pool else 0.0)

    own = weighed.noises[c]
    first = most = value(alone, own)
    for change in changes:
        noise = change(own)
        if noise is own:
            continue
        other = alone.with_covariances(0, [noise.covariance(row[c]) for row in weighed.runs])
        tried = value(other, noise)
        if tried > most:
            own, alone, most = noise, other, tried
    return weighed.with_noise(c, own, alone) if most > first else weighed


def _others(
    weighed: WeighedRecordings, c: int, best: _Best, recordings: Sequence[int]
) -> list[Callable[[Noise], Noise]]:
    """Changes of a channel's noise that are worth a try, one after the other."""
    own, evidence = weighed.noises[c], weighed.evidence
    changes: list[Callable[[Noise], Noise]] = [lambda x: replace(x, wander=0.0)] if own.wander else []
    sticks = [np.concatenate([row[c].sticks[k] for row in weighed.runs]) for k in range(len(weighed.runs[0][c].sticks))]
    others = [k for k, x in enumerate(sticks) if not np.array_equal(x, sticks[own.width])]
    changes += [lambda x, k=k: replace(x, width=k) for k in others]
    found = [t for t in best.taken if c in evidence.reached(evidence.items[t.item])]
    if found:
        learnt = (weighed.bare(c), weighed.noise_of_rest(c, _added(weighed, c, best, found, recordings)))
        changes += [lambda x, other=other: replace(other, width=x.width) for other in learnt]
    return changes


def _added(
    weighed: WeighedRecordings, c: int, best: _Best, found: Sequence[Member], recordings: Sequence[int]
) -> list[Array]:
    """What explanations add to a channel of each recording (n,)."""
    evidence, members = weighed.evidence, Members(best.search.on, [(t.item, t.size) for t in best.taken])
    return [
        np.sum([evidence.contribution(i, c, evidence.items[t.item], members.of(t.item)) for t in found], axis=0)
        for i in recordings
    ]


def _best(weighed: WeighedRecordings, recordings: Sequence[int], barred: Collection[str], tolerance: float) -> _Best:
    """The best set that simple moves reach from nothing."""
    out = {h for h, x in enumerate(weighed.pool) if x.key in barred}
    search = Search(
        ProjectedEvidence(weighed.evidence, recordings, weighed.beside.weight(tolerance)), weighed.pool, out
    )
    gained, taken = search.run((), exchange=False) if weighed.pool else (0.0, [])
    prior = sum(x.log_prior for x in weighed.noises)
    return _Best(prior + search.on.null + gained, search, tuple(taken), tolerance)
