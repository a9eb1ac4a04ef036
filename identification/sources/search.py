"""Search what a model leaves out by its evidence, fit what was found, and search again."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..deciding import LAW_ERROR, ROUNDS
from ..evidence.arm import WeighedRecordings
from ..evidence.members import Members, log_bayes
from ..evidence.rounds import as_names, share_of_residual
from ..evidence.search import MemberOdds, Search
from ..evidence.tolerant import searched
from ..nuisance.noise import Noise
from .fit import fit, kept_columns, linearised
from .own import refitted
from .source import GridPoint, Linearisation, ModelPoint, Source
from .weigh import by_themselves, covariances, weigh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Naming:
    """An effect that a search chose: its place, log Bayes factor and posterior share; and its rivals, each with a
    share.
    """

    placed: PlacedEffect
    channels: tuple[int, ...]
    gain: float
    share: float
    rivals: tuple[tuple[PlacedEffect, float], ...]


@dataclass(frozen=True)
class Trial:
    """An effect by itself on top of the model as given: log posterior odds, and share of the whitened residual."""

    placed: PlacedEffect
    odds: float
    explained: float
    smallest: Mapping[str, float]


@dataclass(frozen=True)
class Selection:
    """What a search found: names, the fits of the model as given and of the last one, the last noise, and the first
    round's trials.
    """

    names: tuple[Naming, ...]
    first: Linearisation
    last: Linearisation
    weighed: WeighedRecordings
    trials: tuple[Trial, ...]

    @property
    def noises(self) -> tuple[Noise, ...]:
        """The noise of every channel."""
        return self.weighed.noises


def search(
    source: Source,
    given: ModelPoint,
    *,
    barred: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Selection:
    """Add effects to a model until no further name raises the posterior of the training recordings."""
    train = source.train
    progress(f"comparing {len(train)} recordings with the model as given")
    first = here = linearised(source, train, source.settled(given, train))
    shifted = kept_columns(source, first)
    names: list[Naming] = []
    trials: tuple[Trial, ...] = ()
    weighed: WeighedRecordings | None = None
    for number in range(1, ROUNDS + 1):
        progress(f"round {number}: comparing each effect at each place")
        weighed, _ = opened(source, given, here)
        weighed, made, slots, _ = searched(weighed, range(len(train)), barred, range(len(weighed.noises)))
        trials = trials or _trials(made)
        error = LAW_ERROR**2 * _taken_out(first, here, weighed)
        slots = [s for s in as_names(made, slots) if _large(made, s, error)]
        chosen = _chosen(made, slots) if slots else []
        if not chosen:
            break
        added, values = [], {}
        for slot, beside in chosen:
            placed, own = _started(made, slot, beside)
            names.append(_name(weighed, slot))
            added.append(placed)
            values |= own
        progress("fitting " + ", ".join(f"{p.effect.name} at {p.at}" for p in added))
        start = here.at.with_effects(added, values)
        _, here = refitted(source, given, start, weighed, shifted)
    assert weighed is not None
    if not names:
        here = fit(source, given, here.at, covariances(weighed), shifted)
    return Selection(tuple(names), first, here, weighed, trials)


def _taken_out(first: Linearisation, here: Linearisation, weighed: WeighedRecordings) -> Array:
    """Log-likelihood that the names so far took out of each channel (c,): a law that is wrong by a share of itself
    leaves the square of that share of it."""
    taken = np.zeros(len(weighed.noises))
    for before, now, row in zip(first.residuals, here.residuals, covariances(weighed), strict=True):
        for c, k in enumerate(row):
            taken[c] += 0.5 * float(before[:, c] @ k.solve(before[:, c]) - now[:, c] @ k.solve(now[:, c]))
    return np.maximum(taken, 0.0)


def opened(
    source: Source, given: ModelPoint, here: Linearisation, known: WeighedRecordings | None = None
) -> tuple[WeighedRecordings, dict[str, GridPoint]]:
    """The training recordings under a fit with every hypothesis, and the laws without amplitudes, which are fitted by
    themselves."""
    weighed = weigh(source, source.train, given, here, known, search=True)
    if not any(h.named and h.items[0].whole for h in weighed.pool):
        return weighed, {}
    own = by_themselves(source, given, here, weighed)
    return weigh(source, source.train, given, here, known or weighed, search=True, alone=own), own


def _large(made: Search, slot: MemberOdds, error: Array) -> bool:
    """Does a name add more than the error of the laws that are there?"""
    reached = made.on.evidence.reached(made.on.evidence.items[slot.taken.item])
    return not made.pool[slot.taken.hypothesis].named or slot.gain >= float(np.sum(error[reached]))


def _chosen(made: Search, slots: Sequence[MemberOdds]) -> list[tuple[MemberOdds, Sequence[MemberOdds]]]:
    """Names to take, with what stands beside each: one at a time on every channel, for what is not in proportion to its
    size leaves a rest, which others would take up.

    The likeliest by itself is taken, where one by itself is likelier than none and no nameless curve is there; else the
    one that the best set gains most by.
    """
    evidence, odds = made.on.evidence, made.scan([]).odds.copy()
    odds[[h for h, x in enumerate(made.pool) if h in made.barred or not x.named]] = -np.inf

    def reached(slot: MemberOdds) -> set[int]:
        return set(evidence.reached(evidence.items[slot.taken.item]))

    found, taken = [], set()
    for slot in sorted((s for s in slots if made.pool[s.taken.hypothesis].named), key=lambda s: -s.gain):
        reach = reached(slot)
        if reach & taken:
            continue
        taken |= reach
        own = [h for h, x in enumerate(made.pool) if reach & set(evidence.reached(x.items[0]))]
        h = max(own, key=lambda h: odds[h])
        curved = any(not made.pool[s.taken.hypothesis].named and reached(s) & reach for s in slots)
        if odds[h] > 0 and not curved:
            (single,) = as_names(made, [made.slot([made.take([], h)], 0)])
            found.append((single, [single]))
        else:
            found.append((slot, slots if curved else [slot]))
    return found


def _started(made: Search, slot: MemberOdds, beside: Sequence[MemberOdds]) -> tuple[PlacedEffect, dict[str, float]]:
    """An effect that was taken, and the values that its parameters start from."""
    item = made.on.evidence.items[slot.taken.item]
    variant: GridPoint = item.label
    amplitude = item.spread * made.members([s.taken for s in beside]).of(slot.taken.item)
    values = dict(variant.values)
    bounds = {f"{variant.placed.key}.{x.name}": (x.low, x.high) for x in variant.placed.effect.parameters}
    for key, value in zip(variant.amplitudes, amplitude, strict=False):
        values[key] = float(np.clip(variant.origin.get(key, 0.0) + value, *bounds[key]))
    return variant.placed, values


def _name(weighed: WeighedRecordings, slot: MemberOdds) -> Naming:
    own = weighed.pool[slot.taken.hypothesis]
    order = [h for h in np.argsort(-slot.shares[:-1]) if weighed.pool[h].named and h != slot.taken.hypothesis]
    rivals = [(weighed.pool[h].label, float(slot.shares[h])) for h in order[:6]]
    channels = weighed.evidence.reached(weighed.evidence.items[slot.taken.item])
    return Naming(own.label, tuple(channels), slot.gain, float(slot.shares[slot.taken.hypothesis]), tuple(rivals))


def _trials(made: Search) -> tuple[Trial, ...]:
    rows, found = made.scan([]), []
    for h, x in enumerate(made.pool):
        if x.named:
            taken = made.take([], h)
            alone = Members(made.on, [(taken.item, taken.size)])
            explained = share_of_residual(made, taken.item, alone.of(taken.item))
            found.append(Trial(x.label, float(rows.odds[h]), explained, _smallest(made, h)))
    return tuple(sorted(found, key=lambda c: -c.odds))


def _smallest(made: Search, h: int) -> dict[str, float]:
    """The value of each amplitude from which on the name would have had a posterior above a half, shapes as they are
    at the first point of the grid. Of a law without amplitudes, where it does least on its grid: it grows with a first
    parameter that is zero where there is no effect, and else with one over it."""
    x, start = made.pool[h], sum(len(y.items) for y in made.pool[:h])
    k = 0
    if x.items[0].whole:
        k = min((k for k, item in enumerate(x.items) if item.whole), key=lambda k: x.items[k].label.size)
    item, curvature, found = x.items[k], made.on.own(start + k), {}
    v: GridPoint = item.label
    spread = np.full(1, 1 / v.size) if item.whole else item.spread
    t = np.geomspace(1e-4, 1e2, 400)
    first = v.placed.effect.parameters[0]
    for k, key in enumerate(v.amplitudes or [f"{v.placed.key}.{first.name}"]):
        h_of_one = curvature[k : k + 1, k : k + 1] * (spread[k] / item.spread[k]) ** 2
        many = np.broadcast_to(h_of_one, (len(t), 1, 1))
        gain = log_bayes(many, h_of_one[0] * t[:, None], np.tile(item.positive[k : k + 1], (len(t), 1))).max(axis=1)
        enough = np.flatnonzero(gain + x.prior > 0)
        if len(enough):
            size = v.origin.get(key, 0.0) + float(t[enough[0]] * spread[k])
            if item.whole:
                size = v.values[key] / size if first.zero or v.inverse else v.values[key] * size
            found[key.rpartition(".")[2]] = size
    return found
