"""What the members of a best set stand for: names, their special cases, and their rivals."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..deciding import ALIKE, CLASS, NEARLY
from ..evidence.members import Members
from ..evidence.search import Member, MemberOdds, Search
from .kind import RecordingKind
from .selection import F, RivalOdds, Trial

Array = NDArray[np.float64]


def as_names(search: Search, slots: Sequence[MemberOdds]) -> list[MemberOdds]:
    """The slots after replacement: a curve that a named law nearly reproduces becomes that name, and a law that nearly
    equals one of its special cases becomes that special case (the principle of marginality: Nelder 1977). The
    difference is found afterwards.
    """
    taken = [s.taken for s in slots]
    for k, t in enumerate(taken):
        amplitudes = search.members(taken).of(t.item)
        energy = float(amplitudes @ search.on.own(t.item) @ amplitudes)
        out = {x.hypothesis for x in taken} | search.barred
        simpler = [h for h in _simpler(search, t) if h not in out]
        alike = {h: likeness(search, t.item, amplitudes, energy, h) for h in simpler}
        best = max(alike, key=lambda h: alike[h], default=None)
        if best is not None and alike[best] > NEARLY:
            taken[k] = search.take(taken[:k] + taken[k + 1 :], best)
    found = []
    for k, (s, t) in enumerate(zip(slots, taken, strict=True)):
        if s.taken == t:
            found.append(s)
            continue
        # It speaks for what it stands for, which has a turn of its own when it is in the model.
        other = search.slot(taken, k)
        shares = s.shares.copy()
        shares[t.hypothesis] += shares[s.taken.hypothesis]
        shares[s.taken.hypothesis] = 0.0
        found.append(replace(other, shares=shares))
    return found


def _simpler(search: Search, t: Member) -> list[int]:
    """Names that could stand for a curve on their channel; special cases of a name at its place."""
    own, evidence = search.pool[t.hypothesis], search.on.evidence
    if own.named:
        wanted = {f"{name}.{own.label.at}" for name in own.label.effect.contains}
        return [h for h, x in enumerate(search.pool) if x.key in wanted]
    reached = evidence.reached(evidence.items[t.item])
    return [h for h, x in enumerate(search.pool) if x.named and evidence.reached(x.items[0]) == reached]


def rivals(search: Search, slot: MemberOdds, amplitudes: Array) -> tuple[RivalOdds, ...]:
    """Names that could stand in a slot: likely ones, and those whose law can do what the slot's does; a whole law that
    holds the slot's and, as it may, another name's of the set."""
    found, on = [], search.on
    own, name = slot.taken.item, search.pool[slot.taken.hypothesis].label
    energy = float(amplitudes @ on.own(own) @ amplitudes)
    reached = set(on.evidence.reached(on.evidence.items[own]))
    for h, x in enumerate(search.pool):
        if h == slot.taken.hypothesis or not x.named:
            continue
        if not np.isfinite(slot.odds[h]) and (h in search.barred or not _holds(x.label, name)):
            continue
        share = float(slot.shares[h])
        alike = share >= CLASS
        if not alike and reached & set(on.evidence.reached(x.items[0])):
            alike = likeness(search, own, amplitudes, energy, h) >= ALIKE**2
        if alike or share >= 0.005:
            found.append(RivalOdds(x.label, share, not alike))
    return tuple(sorted(found, key=lambda r: (r.separable, -r.probability))[:6])


def _holds(whole: PlacedEffect, part: PlacedEffect) -> bool:
    """Is a law, at its place, a special case of the other one?"""
    return whole.at == part.at and part.effect.name in whole.effect.contains


def likeness(search: Search, own: int, amplitudes: Array, energy: float, other: int) -> float:
    """Largest share of what an item adds that another hypothesis's law by itself can add as well [0 to 1].

    Amplitudes that cannot be negative stay positive: friction that falls with heat cannot reproduce friction that
    grows.
    """
    best, on = 0.0, search.on
    start = sum(len(h.items) for h in search.pool[:other])
    for number, item in enumerate(search.pool[other].items, start):
        k = item.label.count
        cross = (amplitudes @ on.curvature(own, number))[:k]
        curvature = on.own(number)[:k, :k]
        curvature = curvature + (1e-9 * np.trace(curvature) + 1e-300) * np.eye(k)
        free = np.arange(k)
        while len(free):
            solved = np.linalg.solve(curvature[np.ix_(free, free)], cross[free])
            negative = item.positive[free] & (solved < 0)
            if not negative.any():
                best = max(best, float(cross[free] @ solved) / max(energy, 1e-300))
                break
            free = free[~negative]
    return best


def share_of_residual(search: Search, item: int, amplitudes: Array) -> float:
    """Share that an item explains of its channels' whitened residual beside all nuisances [0 to 1]."""
    on = search.on
    reached = on.evidence.reached(on.evidence.items[item])
    energy = sum(on.left(c) for c in reached)
    gained = 2 * float(amplitudes @ on.score(item)) - float(amplitudes @ on.own(item) @ amplitudes)
    return float(np.clip(gained / max(energy, 1e-300), 0.0, 1.0))


def reached(made: Search, slot: MemberOdds) -> list[int]:
    """Channels that the item of a slot has columns on."""
    return made.on.evidence.reached(made.on.evidence.items[slot.taken.item])


def trials(kind: RecordingKind[F], made: Search) -> tuple[Trial, ...]:
    """Every effect at every place by itself, on top of a fit; the likeliest first."""
    if not made.pool:
        return ()
    rows, found = made.scan([]), []
    for h, x in enumerate(made.pool):
        if x.named:
            own = made.take([], h)
            alone = Members(made.on, [(own.item, own.size)])
            explained = share_of_residual(made, own.item, alone.amplitudes)
            found.append(Trial(x.label, explained, float(rows.odds[h]), kind.smallest(made, h)))
    return tuple(sorted(found, key=lambda t: -t.odds))
