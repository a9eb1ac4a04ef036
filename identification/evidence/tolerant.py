"""The search with what the evidence chooses beside it: the masses' tolerance, and each channel's noise."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..deciding import TOLERANCES
from ..nuisance.noise import Noise
from .arm import Weighed
from .evidence import Projected
from .search import Search, Slot, Taken


@dataclass(frozen=True)
class _Best:
    """The best set of a search, its log evidence, and the tolerance of the masses."""

    value: float
    search: Search
    taken: tuple[Taken, ...]
    tolerance: float


def searched(
    weighed: Weighed, recordings: Sequence[int], barred: Collection[str], channels: Collection[int]
) -> tuple[Weighed, Search, list[Slot], float]:
    """The best set of explanations of some recordings, with the noise and the tolerance of the masses that go with it.

    Chosen before the search, a wide tolerance would take a payload in; without any, it would be named a payload. So
    with the noise: beside all that could be missing, a torque that wanders is taken for some of it; beside nothing,
    what is missing is taken for a wander. Where something is found, both are tried; and everywhere that nothing
    wanders. ``channels`` are those of which that may have changed.
    """
    masses = weighed.beside.tolerant
    tolerances = TOLERANCES if masses.stop > masses.start else TOLERANCES[:1]
    best = max((_best(weighed, recordings, barred, x) for x in tolerances), key=lambda b: b.value)
    for c in sorted(channels):
        for noise in _others(weighed, c, best):
            other = weighed.with_noise(c, noise(weighed.noises[c]))
            tried = _best(other, recordings, barred, best.tolerance, best.taken)
            if tried.value > best.value:
                weighed, best = other, tried
    return weighed, best.search, best.search.answer(), best.tolerance


def _others(weighed: Weighed, c: int, best: _Best) -> list[Callable[[Noise], Noise]]:
    """Changes of a channel's noise that are worth a try, one after the other."""
    own, evidence = weighed.noises[c], weighed.evidence
    changes: list[Callable[[Noise], Noise]] = [lambda x: replace(x, wander=0.0)] if own.wander else []
    sticks = [np.concatenate([row[c].sticks[k] for row in weighed.runs]) for k in range(len(weighed.runs[0][c].sticks))]
    others = [k for k, x in enumerate(sticks) if not np.array_equal(x, sticks[own.width])]
    changes += [lambda x, k=k: replace(x, width=k) for k in others]
    if any(c in evidence.reached(evidence.items[t.item]) for t in best.taken):
        bare = weighed.bare(c)
        changes.append(lambda x: replace(bare, width=x.width))
    return changes


def _best(
    weighed: Weighed,
    recordings: Sequence[int],
    barred: Collection[str],
    tolerance: float,
    start: Sequence[Taken] = (),
) -> _Best:
    """The best set that simple moves reach from a start."""
    out = {h for h, x in enumerate(weighed.pool) if x.key in barred}
    search = Search(Projected(weighed.evidence, recordings, weighed.beside.weight(tolerance)), weighed.pool, out)
    gained, taken = search.run(start, exchange=False) if weighed.pool else (0.0, [])
    prior = sum(x.log_prior for x in weighed.noises)
    return _Best(prior + search.on.null + gained, search, tuple(taken), tolerance)
