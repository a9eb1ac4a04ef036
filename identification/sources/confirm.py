"""Confirm names on the held-out recordings: their log density given the training ones, with and without each name.

As in `evidence.confirm`: without an effect the rest is fitted again, and both predict the held-out recordings, every
nuisance integrated out. A name stays if that density falls without it by more than it scatters over blocks of time. By
the same rule a nameless curve of the last search stays.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..deciding import DISCREPANCY, GATE, TOLERANCES
from ..evidence.arm import WeighedRecordings
from ..evidence.gain import Blocks, Remaining, scatter
from ..evidence.members import Members
from ..evidence.pool import Item
from ..evidence.projected import ProjectedEvidence
from ..evidence.rounds import as_names, share_of_residual
from ..evidence.search import MemberOdds, Search
from ..evidence.selection import Remainder
from ..evidence.tolerant import searched
from .fit import fit, kept_columns, linearised
from .search import Naming, Selection, opened
from .source import GridPoint, Linearisation, ModelPoint, Source
from .weigh import covariances, point_key, weigh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOutLoss:
    """What the held-out recordings lose without an effect: log density and its scatter; the fit without it, on the
    training and on the held-out recordings."""

    gain: float
    scatter: float
    train: Linearisation
    held: Linearisation

    @property
    def sure(self) -> float:
        """The loss in units of its scatter."""
        return self.gain / max(self.scatter, 1e-12)


@dataclass(frozen=True)
class Confirmation:
    """The confirmed names with the held-out loss of each, the rejected ones, the last fit, and the log density of the
    held-out recordings.
    """

    names: tuple[Naming, ...]
    missed: Mapping[str, HeldOutLoss]
    rejected: tuple[Naming, ...]
    train: Linearisation
    held: Linearisation
    density: float
    noise: WeighedRecordings
    """Of all recordings."""


def confirm(
    source: Source, given: ModelPoint, found: Selection, progress: Callable[[str], None] = lambda _: None
) -> Confirmation:
    """Remove the name with the smallest held-out loss, until every name's loss is beyond its scatter."""
    held, last, names = source.held, found.last, list(found.names)
    shifted, own = kept_columns(source, last), covariances(found.weighed)
    progress("confirming on the held-out recordings")
    there = linearised(source, held, source.settled(last.at, held))
    beside = kept_columns(source, there)
    could = [[x[:, c] for x in there.columns] for c in range(len(source.channels))]
    noise = replace(found.weighed, runs=[*found.weighed.runs, *source.noise_channels(held, there, could)])
    whole = _forecast(source, given, last, there, noise)
    missed: dict[str, HeldOutLoss] = {}
    rejected: list[Naming] = []
    while names:
        for name in names:
            key = name.placed.key
            rest = fit(source, given, last.at.without(key), own, shifted)
            other = linearised(source, held, source.settled(rest.at, held), beside)
            density, left = _forecast(source, given, rest, other, noise, source.own_shifts(name.placed))
            missed[key] = HeldOutLoss(whole[0] - density, scatter(left, whole[1], _blocks(source)), rest, other)
        weakest = min(names, key=lambda n: missed[n.placed.key].sure)
        if missed[weakest.placed.key].sure > GATE:
            break
        names.remove(weakest)
        rejected.append(weakest)
        gone = missed.pop(weakest.placed.key)
        last, there = gone.train, gone.held
        whole = _forecast(source, given, last, there, noise)
    return Confirmation(tuple(names), missed, tuple(rejected), last, there, whole[0], noise)


def _forecast(
    source: Source,
    given: ModelPoint,
    here: Linearisation,
    there: Linearisation,
    known: WeighedRecordings,
    tolerance_of_name: Collection[int] = (),
) -> tuple[float, list[Remaining]]:
    """Log density of the held-out recordings given the training ones, averaged over how exactly the shifts may be
    known, and what is left of each.

    Without a name, the shifts that are its own tolerance are known to their deviations alone, and not from the training
    recordings: learnt there they would be the effect itself under another name, however many deviations it takes.
    """
    weighed = weigh(source, [*source.train, *source.held], given, _joined(here, there), known, search=False)
    evidence, n = weighed.evidence, len(source.train)
    every = range(n, n + len(source.held))
    masses = weighed.beside.tolerant
    priors, ons = [], []
    for tolerance in (*TOLERANCES, *weighed.beside.more) if masses.stop > masses.start else TOLERANCES[:1]:
        weight = weighed.beside.weight(tolerance)
        own = ProjectedEvidence(evidence, range(n), weight)
        priors.append(own.null)
        mean, covariance = own.posterior(evidence.n_always)
        for k in (len(here.at.values) + s for s in tolerance_of_name):
            mean[k], covariance[k], covariance[:, k] = 0.0, 0.0, 0.0
            covariance[k, k] = weight[k] ** 2
        ons.append(ProjectedEvidence(evidence, every, weight, (mean, covariance)))
    both = np.array(priors) + [on.null for on in ons]
    always = ons[int(np.argmax(both))].beside([])
    left = [evidence.left(i, always, []) for i in every]
    return float(np.logaddexp.reduce(both) - np.logaddexp.reduce(priors)), left


def _blocks(source: Source) -> list[Blocks]:
    return [partial(source.blocks, i) for i in source.held]


def _joined(here: Linearisation, there: Linearisation) -> Linearisation:
    # What is the held-out recordings' own stands there alone.
    return Linearisation(there.at, (*here.residuals, *there.residuals), (*here.columns, *there.columns))


def remainders(source: Source, given: ModelPoint, best: Confirmation, barred: Collection[str]) -> tuple[Remainder, ...]:
    """Nameless curves beside the confirmed model that the held-out recordings confirm."""
    train, numbers = source.train, [*source.train, *source.held]
    if not source.curves(numbers):
        return ()
    weighed, own = opened(source, given, best.train, replace(best.noise, runs=best.noise.runs[: len(train)]))
    weighed, made, slots, tolerance = searched(weighed, train, barred, range(len(weighed.noises)))
    kept, items = list(as_names(made, slots)), made.on.evidence.items
    if not any(_nameless(made, s) for s in kept):
        return ()
    # Of the held-out recordings only what was chosen is worked out.
    only = {point_key(x) for s in kept if isinstance(x := items[s.taken.item].label, GridPoint)}
    noise = replace(best.noise, noises=weighed.noises)
    weighed = weigh(source, numbers, given, _joined(best.train, best.held), noise, search=True, alone=own, only=only)
    both = ProjectedEvidence(weighed.evidence, range(len(numbers)), weighed.beside.weight(tolerance))
    there = {_told(x): k for k, x in enumerate(weighed.evidence.items)}
    at = {k: there[_told(x)] for k, x in enumerate(items) if _told(x) in there}
    kept = [s for s in kept if s.taken.item in at]
    while True:
        told = {k: _remainder(source, made, both, at, kept, k) for k, s in enumerate(kept) if _nameless(made, s)}
        weakest = min(told, key=lambda k: told[k].held, default=None)
        if weakest is None or told[weakest].held > GATE:
            break
        kept.pop(weakest)
    members, scale = Members(made.on, _pairs(kept)), source.scale()
    found = []
    for k, remainder in told.items():
        item, c = kept[k].taken.item, remainder.channel
        own = [made.on.added(i, c, item, members.of(item)) for i in train]
        # What is less than any model has wrong is not told.
        if np.sqrt(np.mean(np.concatenate(own) ** 2)) >= DISCREPANCY * scale[c]:
            found.append(remainder)
    return tuple(sorted(found, key=lambda r: -r.explained))


def _nameless(made: Search, slot: MemberOdds) -> bool:
    return not made.pool[slot.taken.hypothesis].named


def _told(item: Item) -> tuple[Any, int]:
    """What tells an item from every other: an effect's point or a curve, and how many columns it has there."""
    return point_key(item.label) if isinstance(item.label, GridPoint) else item.label, len(item.index)


def _pairs(slots: Sequence[MemberOdds]) -> list[tuple[int, float]]:
    return [(s.taken.item, s.taken.size) for s in slots]


def _remainder(
    source: Source,
    made: Search,
    both: ProjectedEvidence,
    at: Mapping[int, int],
    kept: Sequence[MemberOdds],
    k: int,
) -> Remainder:
    """One curve of a set: what it is, and what the held-out recordings gain by it; ``at``: numbers in ``both`` of what
    was searched."""

    def beside(some: Sequence[MemberOdds]) -> tuple[float, list[Remaining]]:
        own, all_of_it = Members(made.on, _pairs(some)), Members(both, [(at[x], size) for x, size in _pairs(some)])
        mean = [(at[item], own.of(item)) for item, _ in _pairs(some)]
        # Shifts may be a recording's own: what stands beside is its mean on all of them.
        always, pairs = both.beside(mean), [(both.evidence.items[item], a) for item, a in mean]
        return all_of_it.value - own.value, [both.evidence.left(i, always, pairs) for i in source.held]

    density, whole = beside(kept)
    other, rest = beside([s for s in kept if s is not kept[k]])
    item = kept[k].taken.item
    c, words = made.on.evidence.items[item].label
    explained = share_of_residual(made, item, Members(made.on, _pairs(kept)).of(item))
    held = (density - other) / max(scatter(rest, whole, _blocks(source)), 1e-12)
    return Remainder(c, words, kept[k].gain, explained, held)
