"""Search, fit what was found jointly, and search again for what is still missing."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, PlacedEffect
from ..deciding import ALIKE, CLASS, DRIVEN, LAW_ERROR, NEARLY, ROUNDS
from ..fitting.base_parameters import BaseParameters
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit, fit
from ..search.candidates import free_parameters, library
from ..search.closed_loop import planned
from ..search.refit import assemble, refitted
from ..search.rest import fitted
from .arm import WeighedRecordings, weigh
from .hypotheses import parts_of, remembers, rings
from .members import Members, log_bayes
from .rival import RivalOdds
from .search import Member, MemberOdds, Search
from .selection import ArmNaming, ArmSelection, ArmTrial
from .tolerant import searched

Array = NDArray[np.float64]


def search(
    model: Model,
    base: BaseParameters | None,
    scales: Mapping[str, Scales],
    train: Sequence[Experiment],
    held: Sequence[Experiment],
    *,
    before: ArmSelection | None = None,
    barred: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> ArmSelection:
    """Add effects to a model until no further name raises the posterior.

    Parameters
    ----------
    model : Model
        Baseline.
    base : BaseParameters or None
        With ``inertia = "free"``.
    scales : mapping of str to Scales
    train, held : sequence of Experiment
        What is searched; and what is weighed beside it, but not looked at before the confirmation.
    before : ArmSelection, optional
        An earlier search of the same: its baseline, noise and first columns are not worked out again.
    barred : collection of str
        Keys of effects that must not be named.
    progress : callable
        Told in a few words what is under way.
    seed : int
    """
    both, n = [*train, *held], len(train)
    if before is None:
        progress("fitting the baseline")
        assembly = assemble(model, base, scales)
        first = fit(assembly, fitted(assembly, train), progress=progress, seed=seed)
    else:
        first = before.first
    found, named = first, []
    instruments = planned(found, train, others=held, driven=DRIVEN)
    noises = before.weighed.noises if before is not None else None
    opening: WeighedRecordings | None = None
    trials: tuple[ArmTrial, ...] = before.trials if before is not None else ()
    tuned = _tuned(model, base, scales, train, first, seed) if before is None else before.tuned
    channels = None if before is None else _reached_by(before.opening, barred)
    barred = set(barred)
    for number in range(1, ROUNDS + 1):
        progress(f"round {number}: comparing each effect at each place")
        if number == 1 and before is not None:
            weighed = before.opening
        else:
            weighed = weigh(model, found, both, instruments, n, scales, noises, tuned=tuned)
        weighed, made, slots, tolerance = searched(
            weighed, range(n), barred, range(len(weighed.noises)) if channels is None else channels
        )
        opening = opening or weighed
        noises = weighed.noises
        if not trials:
            trials = _trials(made, weighed)
        slots = as_names(made, slots)
        news = [s for s in slots if weighed.pool[s.taken.hypothesis].named]
        if not news:
            break
        # What adds less than the error of laws that are not fitted yet waits until they are.
        least = LAW_ERROR**2 * made.members([s.taken for s in slots]).value
        error = _error_of_laws(opening, weighed)
        large = [s for s in news if s.gain >= LAW_ERROR**2 * sum(error[c] for c in _reached(weighed, s))]
        news = [s for s in large if s.gain >= least] or large
        if not news:
            break
        alone = made.scan([]).odds
        leading = max(news, key=lambda s: alone[s.taken.hypothesis])
        if remembers(weighed.pool[leading.taken.hypothesis].label):
            # What rings or lags explains little before its frequency is fitted: nothing is judged beside it.
            news = [leading]
        start: dict[str, float] = {}
        members = made.members([s.taken for s in slots])
        for s in news:
            name, own = _name(made, members, s, weighed, found, instruments[0])
            named.append(name)
            start |= own
        placed = [x.placed for x in named[-len(news) :]]
        channels = {c for x in named[-len(news) :] for c in x.channels}
        model = model.with_effects(placed, start)
        barred |= frozenset().union(*(parts_of(p) for p in placed))
        progress("refitting with " + ", ".join(f"{p.effect.name} at {p.at}" for p in placed))
        assembly = assemble(model, base, scales)
        found = refitted(found, assembly, fitted(assembly, train), any(rings(p) for p in placed), seed)
        instruments = planned(found, train, instruments, others=held, driven=DRIVEN)
    assert opening is not None
    return ArmSelection(
        first,
        model,
        found,
        tuple(named),
        trials,
        _trials(made, weighed),
        opening,
        weighed,
        tuple(slots),
        made,
        tuple(instruments),
        tolerance,
        tuned,
    )


def _tuned(
    model: Model,
    base: BaseParameters | None,
    scales: Mapping[str, Scales],
    train: Sequence[Experiment],
    first: Fit,
    seed: int,
) -> dict[str, Array]:
    """Parameters of every law that rings, fitted on top of the baseline by itself: between two points of a grid over
    its frequency it explains nothing."""
    found = {}
    for p in library(model):
        if rings(p):
            assembly = assemble(model.with_effects([p], {}), base, scales)
            alone = refitted(first, assembly, fitted(assembly, train), True, seed)
            found[p.key] = alone.theta[assembly.index_of(p)]
    return found


def _error_of_laws(opening: WeighedRecordings, weighed: WeighedRecordings) -> Array:
    """Log-likelihood that the names so far took out of each channel of the training recordings (J,).

    A law that is wrong by a share of itself leaves the square of that share of it.
    """
    taken = np.zeros(len(weighed.noises))
    for i in range(weighed.n_train):
        pairs = zip(opening.evidence.channels[i], weighed.evidence.channels[i], strict=True)
        for c, (before, now) in enumerate(pairs):
            energy = float(before.residual @ now.covariance.solve(before.residual))
            taken[c] += 0.5 * (energy - weighed.evidence.energy(i, c))
    return np.maximum(taken, 0.0)


def _reached_by(weighed: WeighedRecordings, keys: Collection[str]) -> set[int]:
    """Channels that some hypotheses reach."""
    evidence = weighed.evidence
    return {c for h in weighed.pool if h.key in keys for x in h.items for c in evidence.reached(x)}


def _reached(weighed: WeighedRecordings, slot: MemberOdds) -> list[int]:
    return weighed.evidence.reached(weighed.evidence.items[slot.taken.item])


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


def _name(
    search: Search,
    members: Members,
    slot: MemberOdds,
    weighed: WeighedRecordings,
    found: Fit,
    experiment: Experiment,
) -> tuple[ArmNaming, dict[str, float]]:
    """A slot as a name with its rivals, and the values its parameters start from."""
    hypothesis, item = weighed.pool[slot.taken.hypothesis], weighed.evidence.items[slot.taken.item]
    variant = item.label
    amplitudes = members.of(slot.taken.item)
    k = max(len(variant.amplitudes), 1)
    values = variant.start((item.spread * amplitudes)[:k])
    free = free_parameters(found.assembly, experiment, found.assembly.evaluate(experiment, found.theta), variant)
    hold = tuple(p.name for p in hypothesis.label.effect.parameters if p.name not in free)
    placed = replace(hypothesis.label, hold=hold)
    start = {f"{placed.key}.{p.name}": float(v) for p, v in zip(placed.effect.parameters, values, strict=True)}
    channels = tuple(weighed.evidence.reached(item))
    rivals = _rivals(search, slot, amplitudes)
    return ArmNaming(placed, channels, slot.gain, float(slot.shares[slot.taken.hypothesis]), rivals), start


def _rivals(search: Search, slot: MemberOdds, amplitudes: Array) -> tuple[RivalOdds, ...]:
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
        k = max(len(item.label.amplitudes), 1)
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


def _trials(search: Search, weighed: WeighedRecordings) -> tuple[ArmTrial, ...]:
    """Every effect at every place by itself, on top of the baseline."""
    rows = search.scan([])
    made = []
    for h, x in enumerate(weighed.pool):
        if x.named:
            own = search.take([], h)
            alone = Members(search.on, [(own.item, own.size)])
            explained = share_of_residual(search, own.item, alone.amplitudes)
            made.append(ArmTrial(x.label, explained, float(rows.odds[h]), _smallest(search, h)))
    return tuple(sorted(made, key=lambda t: -t.odds))


def _smallest(search: Search, h: int) -> dict[str, float]:
    """The value of each amplitude by itself from which on the name would have had a posterior above a half.

    That is where its best log Bayes factor, with the score H t that it then makes, outweighs its prior odds.
    """
    x, found = search.pool[h], {}
    middle = x.items[len(x.items) // 2].label.parameters
    start = sum(len(y.items) for y in search.pool[:h])
    for number, item in enumerate(x.items, start):
        variant = item.label
        if len(variant.amplitudes) != 1 or not np.array_equal(variant.parameters, middle):
            continue
        parameter = variant.placed.effect.parameters[int(variant.amplitudes[0])]
        curvature = search.on.own(number)[:1, :1]
        if not parameter.alone or parameter.grid or curvature[0, 0] <= 1e-12:
            continue
        t = np.geomspace(1e-4, 100.0, 600)
        many = np.broadcast_to(curvature, (len(t), 1, 1))
        gain = log_bayes(many, curvature[0] * t[:, None], np.tile(item.positive[:1], (len(t), 1))).max(axis=1)
        enough = np.flatnonzero(gain + x.prior > 0)
        if len(enough):
            found[parameter.name] = float(t[enough[0]] * item.spread[0])
    return found
