"""The search with what the evidence chooses beside it: the masses' tolerance, and each channel's noise."""

from collections.abc import Collection, Sequence

from ..deciding import TOLERANCES
from .arm import Weighed
from .evidence import Projected
from .search import Search, Slot

Best = tuple[float, Search, float]
"""Log evidence of the best set, its search, and the tolerance of the masses."""


def searched(
    weighed: Weighed, recordings: Sequence[int], barred: Collection[str]
) -> tuple[Weighed, Search, list[Slot], float]:
    """The best set of explanations of some recordings, with the noise and the tolerance of the masses that go with it.

    Chosen before the search, a wide tolerance would take a payload in; without any, it would be named a payload. So
    with the noise: beside all that could be missing, a torque that wanders is taken for some of it; beside nothing,
    what is missing is taken for a wander. Where something is found, both are tried.
    """
    best = _best(weighed, recordings, barred)
    for c in range(len(weighed.noises)):
        _, search, _ = best
        _, taken = search.run(exchange=False) if weighed.pool else (0.0, [])
        evidence = weighed.evidence
        if not any(c in evidence.reached(evidence.items[t.item]) for t in taken):
            continue
        other = weighed.with_noise(c, weighed.bare(c))
        tried = _best(other, recordings, barred)
        if tried[0] > best[0]:
            weighed, best = other, tried
    _, search, tolerance = best
    return weighed, search, search.answer(), tolerance


def _best(weighed: Weighed, recordings: Sequence[int], barred: Collection[str]) -> Best:
    """Over the tolerances of the masses."""
    out = {h for h, x in enumerate(weighed.pool) if x.key in barred}
    found: list[Best] = []
    masses = weighed.beside.tolerant
    for tolerance in TOLERANCES if masses.stop > masses.start else TOLERANCES[:1]:
        search = Search(Projected(weighed.evidence, recordings, weighed.beside.weight(tolerance)), weighed.pool, out)
        prior = sum(x.log_prior for x in weighed.noises)
        found.append(
            (prior + search.on.null + (search.run(exchange=False)[0] if weighed.pool else 0.0), search, tolerance)
        )
    return max(found, key=lambda b: b[0])
