"""Curves that a name nearly is: beside them nothing is asked of the name."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..deciding import NEARLY
from ..evidence.members import Members
from .kind import RecordingKind
from .selection import F, Selection


def without_its_curves(
    kind: RecordingKind[F], found: Selection[F], channels: Sequence[int], final: F, rest: F
) -> Selection[F]:
    """A search without the curves of which a name is the larger part.

    Without the name, a curve that adds v to its channel could grow to d + v, d what the name adds. If d by itself is
    nearly d + v, the name is named in the curve's place (`names.as_names`), and the curve is what it leaves; so it
    does not stand in for the name where the name is tried. Whether the curve has coordinates by which it can grow so
    is not asked: a curve that cannot is missed alike with the name and without it. What the curve takes over from the
    name itself is no part of v.

    Parameters
    ----------
    kind : RecordingKind
    found : Selection
    channels : sequence of int
        That the name reaches.
    final, rest : fit
        With the name, and without it.
    """
    evidence, pool = found.weighed.evidence, found.weighed.pool
    curves = [s for s in found.slots if not pool[s.taken.hypothesis].named]
    if not any(pool[s.taken.hypothesis].label[0] in channels for s in curves):
        return found
    members = Members(found.search.on, [(s.taken.item, s.taken.size) for s in found.slots])
    with_it, without = kind.residuals(final), kind.residuals(rest)
    kept = []
    for s in found.slots:
        if pool[s.taken.hypothesis].named or pool[s.taken.hypothesis].label[0] not in channels:
            kept.append(s)
            continue
        c, amplitudes = pool[s.taken.hypothesis].label[0], members.of(s.taken.item)
        own, both, cross = 0.0, 0.0, 0.0
        for i, (a, b) in enumerate(zip(with_it, without, strict=True)):
            d = b[:, c] - a[:, c]
            whole = d + found.search.on.added(i, c, s.taken.item, amplitudes)
            weighed = evidence.channels[i][c].covariance.solve(whole)
            own += float(d @ evidence.channels[i][c].covariance.solve(d))
            both += float(whole @ weighed)
            cross += float(d @ weighed)
        if np.square(max(cross, 0.0)) <= NEARLY * own * both:
            kept.append(s)
    return found if len(kept) == len(found.slots) else replace(found, slots=tuple(kept))
