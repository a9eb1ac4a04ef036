"""Search, fit what was found jointly, and search again for what is still missing."""

from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import NDArray

from ..deciding import LAW_ERROR, ROUNDS
from ..evidence.prior import parts_of
from ..evidence.search import MemberOdds, Search
from ..evidence.tolerant import searched
from ..evidence.weighed import WeighedRecordings
from .kind import RecordingKind
from .names import as_names, reached, rivals, trials
from .selection import F, Naming, Selection, Trial

Array = NDArray[np.float64]


def search(
    kind: RecordingKind[F],
    *,
    before: Selection[F] | None = None,
    barred: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Selection[F]:
    """Add effects to a model until no further name raises the posterior of the training recordings.

    Parameters
    ----------
    kind : RecordingKind
        The held-out recordings are not looked at.
    before : Selection, optional
        An earlier search of the same: its first fit, noise and columns are not worked out again.
    barred : collection of str
        Keys of effects that must not be named.
    progress : callable
        Told in a few words what is under way.
    """
    first = here = under = kind.first(progress) if before is None else before.first
    weighed = opening = None if before is None else before.opening
    changed = set() if weighed is None else _reached_by(weighed, barred)
    names: list[Naming] = []
    tried: tuple[Trial, ...] = () if before is None else before.trials
    barred = set(barred)
    for number in range(1, ROUNDS + 1):
        progress(f"round {number}: comparing each effect at each place")
        if weighed is None or number > 1:
            known, weighed = weighed, kind.weighed(here, weighed, anew=True)
            changed |= {c for c, x in enumerate(weighed.noises) if known is None or x is not known.noises[c]}
        under = here
        weighed, made, slots, tolerance = searched(weighed, kind.train, barred, changed)
        opening = opening or weighed
        tried = tried or trials(kind, made)
        slots = as_names(made, slots)
        error = LAW_ERROR**2 * _taken_out(kind, first, here, weighed)
        chosen = kind.chosen(made, slots, [s for s in slots if _large(made, s, error)])
        if not chosen:
            break
        news, values = [], {}
        for slot, beside in chosen:
            amplitudes = made.members([s.taken for s in beside]).of(slot.taken.item)
            placed, own = kind.started(here, made, slot, amplitudes)
            channels = tuple(reached(made, slot))
            share = float(slot.shares[slot.taken.hypothesis])
            news.append(Naming(placed, channels, slot.gain, share, rivals(made, slot, amplitudes)))
            values |= own
        names += news
        changed = {c for n in news for c in n.channels}
        added = [n.placed for n in news]
        barred |= frozenset().union(*(parts_of(p) for p in added))
        progress("fitting " + ", ".join(f"{p.effect.name} at {p.at}" for p in added))
        here = kind.fitted(here, added, values, weighed)
    assert weighed is not None
    assert opening is not None
    last = here if names else kind.closed(here, weighed)
    return Selection(
        first, last, tuple(names), tried, trials(kind, made), opening, weighed, under, made, tuple(slots), tolerance
    )


def _taken_out(kind: RecordingKind[F], first: F, here: F, weighed: WeighedRecordings) -> Array:
    """Log-likelihood that the names so far took out of each channel of the training recordings (J,).

    A law that is wrong by a share of itself leaves the square of that share of it.
    """
    taken, rows = np.zeros(len(weighed.noises)), weighed.evidence.channels
    for before, now, row in zip(kind.residuals(first), kind.residuals(here), rows, strict=False):
        for c, own in enumerate(row):
            a, b = before[:, c], now[:, c]
            taken[c] += 0.5 * float(a @ own.covariance.solve(a) - b @ own.covariance.solve(b))
    return np.maximum(taken, 0.0)


def _large(made: Search, slot: MemberOdds, error: Array) -> bool:
    """Does a name add more than the error of the laws that are there?"""
    return not made.pool[slot.taken.hypothesis].named or slot.gain >= float(np.sum(error[reached(made, slot)]))


def _reached_by(weighed: WeighedRecordings, keys: Collection[str]) -> set[int]:
    """Channels that some hypotheses reach."""
    evidence = weighed.evidence
    return {c for h in weighed.pool if h.key in keys for x in h.items for c in evidence.reached(x)}
