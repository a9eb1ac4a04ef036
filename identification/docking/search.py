"""Search what a docking's model leaves out by the one evidence, fit what was found, and search again."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.model import Model, Placed
from ..deciding import ROUNDS
from ..evidence.evidence import Projected
from ..evidence.members import Members, log_bayes
from ..evidence.search import Search, Slot
from ..nuisance.noise import Noise
from .fit import Linear, fit, linearised, shift_columns, start
from .runs import Runs
from .weigh import Variant, Weighed, covariances, weigh


@dataclass(frozen=True)
class Name:
    """An effect taken: where, its log Bayes factor, its posterior share, and who else could stand in its place: effect,
    share."""

    placed: Placed
    gain: float
    share: float
    rivals: tuple[tuple[Placed, float], ...]


@dataclass(frozen=True)
class Candidate:
    """An effect by itself on top of the model as given: log posterior odds, and share of the whitened residual."""

    placed: Placed
    odds: float
    explained: float
    smallest: Mapping[str, float]


@dataclass(frozen=True)
class Found:
    """What a search found: names, the fits as the model came and at the end, the noise at the end, and the first
    round's candidates."""

    names: tuple[Name, ...]
    first: Linear
    last: Linear
    weighed: Weighed
    candidates: tuple[Candidate, ...]

    @property
    def noises(self) -> tuple[Noise, ...]:
        """Of every channel."""
        return self.weighed.noises


def search(
    runs: Runs,
    numbers: Sequence[int],
    model: Model,
    *,
    barred: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Found:
    """Add effects to a docking's model until nothing more raises the posterior."""
    progress(f"simulating {len(numbers)} dockings with the model as given")
    first = here = linearised(runs, numbers, start(model))
    shifted = shift_columns(first)
    names: list[Name] = []
    candidates: tuple[Candidate, ...] = ()
    weighed: Weighed | None = None
    for number in range(1, ROUNDS + 1):
        progress(f"round {number}: weighing each effect at each place")
        weighed = weigh(runs, numbers, model, here, search=True)
        out = {h for h, x in enumerate(weighed.pool) if x.key in barred}
        made = Search(Projected(weighed.evidence, range(len(numbers))), weighed.pool, out)
        if number == 1:
            candidates = _candidates(made)
        slots = made.answer()
        if not slots:
            break
        # One at a time: what is not in proportion to its size leaves a rest, which others would take up.
        best = _first(made, slots)
        placed, values = _started(weighed, made.members([best.taken]), best)
        names.append(_name(weighed, best))
        at = here.at.with_effects([placed], values)
        progress(f"fitting {placed.effect.name} at {placed.at}")
        here = fit(runs, numbers, model, at, covariances(weighed), shifted)
    assert weighed is not None
    if not names:
        here = fit(runs, numbers, model, here.at, covariances(weighed), shifted)
    return Found(tuple(names), first, here, weighed, candidates)


def _first(made: Search, slots: Sequence[Slot]) -> Slot:
    """The name to take first: the likeliest by itself, where one by itself is likelier than none; else the one that the
    best set gains most by."""
    odds = made.scan([]).odds.copy()
    odds[sorted(made.barred)] = -np.inf
    h = int(np.argmax(odds))
    return made.slot([made.take([], h)], 0) if odds[h] > 0 else max(slots, key=lambda slot: slot.gain)


def _started(weighed: Weighed, members: Members, slot: Slot) -> tuple[Placed, dict[str, float]]:
    """An effect that was taken, and the values that its parameters start from."""
    item = weighed.evidence.items[slot.taken.item]
    variant: Variant = item.label
    amplitude = item.spread * members.of(slot.taken.item)
    values = dict(variant.values)
    bounds = {f"{variant.placed.key}.{x.name}": (x.low, x.high) for x in variant.placed.effect.parameters}
    for key, value in zip(variant.amplitudes, amplitude, strict=True):
        values[key] = float(np.clip(value, *bounds[key]))
    return variant.placed, values


def _name(weighed: Weighed, slot: Slot) -> Name:
    own = weighed.pool[slot.taken.hypothesis]
    order = np.argsort(-slot.shares[:-1])
    rivals = [(weighed.pool[h].label, float(slot.shares[h])) for h in order if h != slot.taken.hypothesis]
    return Name(own.label, slot.gain, float(slot.shares[slot.taken.hypothesis]), tuple(rivals[:6]))


def _candidates(made: Search) -> tuple[Candidate, ...]:
    rows, found = made.scan([]), []
    for h, x in enumerate(made.pool):
        taken = made.take([], h)
        alone = Members(made.on, [(taken.item, taken.size)])
        energy = sum(
            made.on.evidence.energy(i, c) for i in made.on.recordings for c in range(len(made.on.evidence.where))
        )
        a = alone.of(taken.item)
        gained = 2 * float(a @ made.on.score(taken.item)) - float(a @ made.on.own(taken.item) @ a)
        found.append(
            Candidate(x.label, float(rows.odds[h]), float(np.clip(gained / max(energy, 1e-300), 0, 1)), _seen(made, h))
        )
    return tuple(sorted(found, key=lambda c: -c.odds))


def _seen(made: Search, h: int) -> dict[str, float]:
    """The value of each amplitude from which on the name would have had a posterior above a half, shapes as they are
    at the first point of the grid."""
    x = made.pool[h]
    item = x.items[0]
    number = sum(len(y.items) for y in made.pool[:h])
    curvature, found = made.on.own(number), {}
    t = np.geomspace(1e-4, 1e2, 400)
    for k, key in enumerate(item.label.amplitudes):
        many = np.broadcast_to(curvature[k : k + 1, k : k + 1], (len(t), 1, 1))
        score = curvature[k, k] * t[:, None]
        gain = log_bayes(many, score, np.tile(item.positive[k : k + 1], (len(t), 1))).max(axis=1)
        enough = np.flatnonzero(gain + x.prior > 0)
        if len(enough):
            found[key.rpartition(".")[2]] = float(t[enough[0]] * item.spread[k])
    return found
