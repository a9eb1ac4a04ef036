"""The nameless part of the remaining residual: curves that the held-out recordings confirm, and bursts."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..deciding import DISCREPANCY, GATE
from ..fitting.experiment import Experiment, Scales
from ..nuisance.bursts import Bursts, ChannelResidual, bursts
from .arm import weigh
from .confirm import ArmConfirmation, blocks
from .gain import Remaining, scatter
from .members import Members
from .projected import ProjectedEvidence
from .rounds import share_of_residual
from .selection import ArmSelection, Remainder
from .tolerant import searched

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NamelessParts:
    """Nameless curves, and bursts by channel."""

    curves: tuple[Remainder, ...]
    bursts: Mapping[int, Bursts]


def remainders(found: ArmSelection, train: Sequence[Experiment], held: Sequence[Experiment]) -> tuple[Remainder, ...]:
    """Nameless curves of the last search that the held-out recordings confirm."""
    n, search, slots = len(train), found.search, found.slots
    evidence = search.on.evidence
    if not slots:
        return ()
    some = evidence.of_items([s.taken.item for s in slots])
    both = ProjectedEvidence(some, range(n + len(held)), found.weighed.beside.weight(found.tolerance))

    def beside(chosen: Sequence[int]) -> tuple[float, list[Remaining]]:
        taken = [(slots[k].taken.item, slots[k].taken.size) for k in chosen]
        own, all_of_it = Members(search.on, taken), Members(both, [(k, slots[k].taken.size) for k in chosen])
        mean = [(item, own.of(item)) for item, _ in taken]
        always = search.on.beside(mean)
        pairs = [(evidence.items[item], a) for item, a in mean]
        return all_of_it.value - own.value, [evidence.left(n + i, always, pairs) for i in range(len(held))]

    kept = list(range(len(slots)))
    made: dict[int, Remainder] = {}
    while kept:
        density, whole = beside(kept)
        made = {}
        members = Members(search.on, [(slots[k].taken.item, slots[k].taken.size) for k in kept])
        for k in kept:
            item = slots[k].taken.item
            if found.weighed.pool[slots[k].taken.hypothesis].named:
                continue
            other, rest = beside([x for x in kept if x != k])
            error = scatter(rest, whole, [partial(blocks, e) for e in held])
            c, curve = evidence.items[item].label
            explained = share_of_residual(search, item, members.of(item))
            made[k] = Remainder(c, curve.words, slots[k].gain, explained, (density - other) / max(error, 1e-12))
        weak = min(made, key=lambda k: made[k].held, default=None)
        if weak is None or made[weak].held > GATE:
            break
        kept.remove(weak)
        made = {}
    # What is less than any model has wrong is not told.
    members = Members(search.on, [(slots[k].taken.item, slots[k].taken.size) for k in made])
    told = []
    for k, remainder in made.items():
        item, c = slots[k].taken.item, remainder.channel
        own = [search.on.added(i, c, item, members.of(item)) for i in range(n)]
        if np.sqrt(np.mean(np.concatenate(own) ** 2)) >= DISCREPANCY * found.weighed.scale[c]:
            told.append(remainder)
    return tuple(sorted(told, key=lambda r: -r.explained))


def left_over(
    best: ArmConfirmation,
    scales: Mapping[str, Scales],
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    barred: Collection[str],
) -> NamelessParts:
    """The nameless parts of the confirmed model's remaining residual."""
    if best.rejected:
        n = len(train)
        own = best.found
        weighed = weigh(best.model, best.fit, [*train, *held], own.instruments, n, scales, own.weighed.noises)
        weighed, made, slots, tolerance = searched(
            weighed, range(n), barred, {c for x in best.rejected for c in x.channels}
        )
        best = replace(best, found=replace(own, weighed=weighed, search=made, slots=tuple(slots), tolerance=tolerance))
    return NamelessParts(remainders(best.found, train, held), _bursts(best.found, train, held))


def _bursts(found: ArmSelection, train: Sequence[Experiment], held: Sequence[Experiment]) -> dict[int, Bursts]:
    """Of every channel, beside all that was found.

    On a suspension or a floating base every joint moves what carries the others, which rings as it likes: nothing is
    said there.
    """
    evidence, on = found.weighed.evidence, found.search.on
    if not found.model.tree.stands:
        return {}
    members = Members(on, [(s.taken.item, s.taken.size) for s in found.slots])
    mean = [(s.taken.item, members.of(s.taken.item)) for s in found.slots]
    always = on.beside(mean)
    told: dict[int, Bursts] = {}
    for c in range(len(evidence.channels[0])):
        parts = []
        for i, e in enumerate([*train, *held]):
            own = evidence.channels[i][c]
            left = own.residual - own.columns @ always[own.index]
            for item, amplitudes in mean:
                left = left - evidence.contribution(i, c, evidence.items[item], amplitudes)
            step = e.motion.period * e.motion.thinning
            parts.append(
                ChannelResidual(left, left * own.covariance.solve(left), found.weighed.runs[i][c].settles == 0, step)
            )
        one = bursts(parts[: len(train)], parts[len(train) :])
        if one is not None:
            told[c] = one
    return told
