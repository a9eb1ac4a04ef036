"""What has no name in the residual: curves and vibration that the held-out recordings confirm, and bursts."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..deciding import DISCREPANCY, GATE
from ..evidence.gain import Remaining, scatter
from ..evidence.members import Members
from ..evidence.search import MemberOdds
from ..evidence.tolerant import Searched, searched, shaken
from ..nuisance.bursts import Bursts
from ..nuisance.noise import Noise
from .confirm import Confirmation
from .kind import RecordingKind
from .names import share_of_residual
from .selection import F, Remainder, Selection
from .vibration import ToldVibration, vibrations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NamelessParts:
    """Nameless curves, bursts and vibration by channel, and each channel's noise with what vibrates."""

    curves: tuple[Remainder, ...]
    bursts: Mapping[int, Bursts]
    vibrations: Mapping[int, ToldVibration] = field(default_factory=dict)
    noises: tuple[Noise, ...] = ()

    @property
    def told(self) -> list[object]:
        """All of it that makes a model incomplete; a burst that occurs once does not."""
        return [*self.curves, *self.vibrations.values(), *(b for b in self.bursts.values() if b.again)]


def left_over(kind: RecordingKind[F], best: Confirmation[F], barred: Collection[str]) -> NamelessParts:
    """The nameless parts of the confirmed model's remaining residual."""
    found = best.found
    if all(h.named for h in found.weighed.pool):
        return NamelessParts((), {})
    if best.rejected or found.searched is not found.last:
        weighed = kind.weighed(best.last, found.weighed)
        changed = {c for x in best.rejected for c in x.channels} or set(range(len(weighed.noises)))
        found = _with(found, searched(weighed, kind.train, barred, changed))
    told: Mapping[int, ToldVibration] = {}
    noises = found.weighed.noises
    if more := shaken(found.weighed, kind.train, barred, found.tolerance):
        other = _with(found, more)
        told = vibrations(kind, other)
        noises = tuple(x if c in told else x.still for c, x in enumerate(other.weighed.noises))
        # Where the held-out recordings do not confirm it, all is as it was before.
        found = _in_noises(kind, other, noises, barred) if told else found
    return NamelessParts(remainders(kind, found, best.last), kind.bursts(found), told, noises)


def _in_noises(
    kind: RecordingKind[F], found: Selection[F], noises: Sequence[Noise], barred: Collection[str]
) -> Selection[F]:
    weighed = found.weighed
    changed = {c for c, x in enumerate(noises) if x is not weighed.noises[c]}
    for c in changed:
        weighed = weighed.in_noise(c, noises[c])
    return _with(found, searched(weighed, kind.train, barred, changed)) if changed else found


def _with(found: Selection[F], again: Searched) -> Selection[F]:
    """A search, done again beside the same fit."""
    weighed, made, slots, tolerance = again
    return replace(found, weighed=weighed, search=made, slots=tuple(slots), tolerance=tolerance)


def remainders(kind: RecordingKind[F], found: Selection[F], fit: F) -> tuple[Remainder, ...]:
    """Nameless curves of a search that the held-out recordings confirm."""
    made, items = found.search, found.search.on.evidence.items
    if not found.nameless:
        return ()
    both, at = kind.with_held(found, fit, [s.taken.item for s in found.slots])

    def pairs(slots: Sequence[MemberOdds]) -> list[tuple[int, float]]:
        return [(s.taken.item, s.taken.size) for s in slots]

    def beside(slots: Sequence[MemberOdds]) -> tuple[float, list[Remaining]]:
        own, all_of_it = Members(made.on, pairs(slots)), Members(both, [(at[x], size) for x, size in pairs(slots)])
        mean = [(at[item], own.of(item)) for item, _ in pairs(slots)]
        # Some of what stands beside is a recording's own: so it is the mean on all of them.
        always, given = both.beside(mean), [(both.evidence.items[item], a) for item, a in mean]
        return all_of_it.value - own.value, [both.evidence.left(i, always, given) for i in kind.held]

    def remainder(kept: Sequence[MemberOdds], whole: tuple[float, list[Remaining]], k: int) -> Remainder:
        """One curve of a set: what it is, and what the held-out recordings gain by it."""
        other, rest = beside([s for s in kept if s is not kept[k]])
        item = kept[k].taken.item
        c, words = items[item].label
        explained = share_of_residual(made, item, Members(made.on, pairs(kept)).of(item))
        error = scatter(rest, whole[1], [partial(kind.blocks, i) for i in kind.held])
        return Remainder(c, words, kept[k].gain, explained, (whole[0] - other) / max(error, 1e-12))

    kept = [s for s in found.slots if s.taken.item in at]
    while True:
        whole = beside(kept)
        told = {k: remainder(kept, whole, k) for k, s in enumerate(kept) if not made.pool[s.taken.hypothesis].named}
        weakest = min(told, key=lambda k: told[k].held, default=None)
        if weakest is None or told[weakest].held > GATE:
            break
        kept.pop(weakest)
    # What is less than any model has wrong is not told.
    members, scale, large = Members(made.on, pairs(kept)), found.weighed.scale, []
    for k, one in told.items():
        item, c = kept[k].taken.item, one.channel
        own = [made.on.added(i, c, item, members.of(item)) for i in kind.train]
        if np.sqrt(np.mean(np.concatenate(own) ** 2)) >= DISCREPANCY * scale[c]:
            large.append(one)
    return tuple(sorted(large, key=lambda r: -r.explained))
