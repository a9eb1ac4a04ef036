"""Named effects and nameless curves of an arm's joints as hypotheses: their columns."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.model import Model, PlacedEffect
from ..deciding import BENDS, SLOPE
from ..evidence.pool import CandidateColumns, Curves, Item
from ..evidence.prior import parts_of
from ..fitting.assembly import TorqueEvaluation, TorqueModel
from ..fitting.experiment import Experiment, Scales
from ..fitting.periodogram import Peaks
from ..nuisance.curve import SMALL, Coordinates, family
from ..nuisance.start import free_responses, springs_back
from ..search.candidates import MOST_OF_WHOLE, EffectVariant, candidate_columns, library, reduced, variants
from .laws import coordinate, remembers
from .whole_mass import by_mass

Array = NDArray[np.float64]

MOST_GRID = 16
"""Points of a grid over several shapes, or of a law with hidden state, that are tried."""

FINE = 12
"""Points from which on a grid over one shape follows the law so finely that no curve need ride along."""

SMALL_STEP = 0.02
"""Relative change of a parameter from which its slope is taken."""


@dataclass(frozen=True)
class ColumnSource:
    """Where columns come from: instrument motions with the model's state along each, the training recordings first."""

    model: Model
    assembly: TorqueModel
    instruments: Sequence[Experiment]
    states: Sequence[TorqueEvaluation]
    n_train: int
    scale: Array
    """RMS torque of each channel in the training recordings (J,)."""
    scales: Mapping[str, Scales]
    tuned: Mapping[str, Array] = field(default_factory=dict)
    """Parameters of laws that were fitted by themselves, by their key: a point more of their grid."""
    peaks: Mapping[str, Peaks] = field(default_factory=dict)
    """Of the residual's periodogram, for laws with a wave's length, by their key: these lengths replace their grid."""

    def coordinates(self, c: int) -> list[Coordinates]:
        """What a joint's curves run over, along each instrument motion."""
        own = self.scales[self.model.joints[c]]
        peak, travel = max(own.speed, 1e-9), own.travel
        return [Coordinates.of(e, s, c, peak, travel) for e, s in zip(self.instruments, self.states, strict=True)]


def curves(
    along: ColumnSource,
    columns: CandidateColumns,
    *,
    small: bool = False,
    more: Collection[str] = (),
) -> dict[tuple[int, str], Item]:
    """Every nameless curve of every channel, or the small ones and some more alone, by channel and words."""
    tree, n = along.model.tree, along.n_train
    alone = not tree.stands
    found = {}
    for c in range(len(along.model.joints)):
        signals = along.coordinates(c)
        if max(float(np.ptp(x.q[:, c])) for x in signals[:n]) < 1e-6:
            continue
        for curve in family(c, along.model.joints, signals[:n], alone):
            if small and curve.words not in {*SMALL, *more, *(coordinate(p.effect) for p in along.model.effects)}:
                continue
            own = [e.to_band(curve.columns(x), c) for e, x in zip(along.instruments, signals, strict=True)]
            k = own[0].shape[1]
            size = float(np.sqrt(np.mean(np.concatenate([(x**2).sum(axis=1) for x in own[:n]])))) or 1.0
            spread = np.full(k, along.scale[c] / size)
            found[c, curve.words] = Item(columns.add({c: own}), spread, np.zeros(k, bool), label=(c, curve.words))
    return found


def names(
    along: ColumnSource, by_words: Curves, columns: CandidateColumns
) -> dict[str, tuple[PlacedEffect, list[Item]]]:
    """Every effect at every place that the model does not have yet, with all its shapes, by its key.

    A part without a shape of its own is in a whole law of the model, amplitude and all; one with a shape may be another
    of its kind.
    """
    have = {p.key for p in along.model.effects}
    in_whole = frozenset().union(*(parts_of(p) for p in along.model.effects))
    found = {}
    for p in library(along.model):
        if have & parts_of(p) or (p.key in in_whole and not any(x.grid for x in p.effect.parameters)):
            continue
        items = _items(along, p, by_words, columns)
        if items:
            found[p.key] = (p, items)
    return found


def _items(along: ColumnSource, p: PlacedEffect, by_words: Curves, columns: CandidateColumns) -> list[Item]:
    own_peaks = along.peaks.get(p.key)
    if own_peaks is not None and not len(own_peaks.waves):
        return []
    if own_peaks is None:
        grid, between = _grid(along.assembly, p)
        tried, prior = list(range(len(grid))), 0.0
    else:
        # Between any two peaks are trials that explain less: their share of the prior is not the peaks'.
        grid, between = _about_peaks(along.assembly, p, own_peaks), True
        # The highest stands in the middle, as the usual point of a grid does.
        tried = [int(k) for k in np.roll(range(1, len(grid), 3), len(own_peaks.waves) // 2 - own_peaks.best)]
        prior = float(np.log(len(own_peaks.waves) / own_peaks.trials))
    made = [_made(along, v) for v in grid]
    extra = None
    if own_peaks is None and len(grid) <= FINE:
        extra = by_words.get((along.assembly.joint_of(p), coordinate(p.effect) or ""))
    # What a law with memory has wrong is mostly its lag.
    lags = remembers(p)
    items: list[Item] = []
    for k in tried:
        v, parts = grid[k], made[k]
        size = None if parts is None else _size(along, parts)
        if parts is None or size is None or not np.any(size > 1e-12):
            continue
        n, own = len(size), parts
        # A curve over a joint's own coordinate says nothing of an axis.
        bent = extra if set(parts) == {along.assembly.joint_of(p)} else None
        neighbours = [x for x in (made[max(k - 1, 0)], made[min(k + 1, len(grid) - 1)]) if x is not None]
        if between and len(neighbours) == 2:
            steps = min(k + 1, len(grid) - 1) - max(k - 1, 0)
            low, high = neighbours
            own = {
                c: [
                    np.hstack([x, (b - a) * (SLOPE / steps)]) for x, a, b in zip(parts[c], low[c], high[c], strict=True)
                ]
                for c in parts
            }
        index = columns.add(own)
        whole = len(v.amplitudes) == 0
        if lags:
            bent = lagging(along, parts, columns)
        for subset in v.subsets():
            some = reduced(v, subset)
            on = size[subset] > 1e-12
            if not on.all():
                continue
            spread = np.ones(1) if whole else 1 / size[subset] / np.sqrt(len(subset))
            positive = np.ones(1, bool) if whole else some.low >= 0
            at = index[subset]
            if len(index) > n:
                at, spread = np.concatenate([at, index[n + subset]]), np.tile(spread, 2)
                positive = np.concatenate([positive, np.zeros(len(subset), bool)])
            if bent is None or whole:
                items.append(Item(at, spread, positive, whole, some, prior))
                continue
            free = np.zeros(len(bent.index), bool)
            for bend in BENDS:
                more = np.concatenate([at, bent.index]), np.concatenate([spread, bend * bent.spread])
                items.append(Item(*more, np.concatenate([positive, free]), whole, some, prior))
    more = _in_ratio(along, grid[0], made[0], columns), _fitted(along, p, columns) if p.key in along.tuned else None
    return [*items, *(x for x in more if x is not None)]


def _in_ratio(
    along: ColumnSource, v: EffectVariant, parts: Mapping[int, Sequence[Array]] | None, columns: CandidateColumns
) -> Item | None:
    """What a place has, by one factor: one number, where any change of it takes as many as the law has."""
    ratio = along.assembly.at(v.placed).once_more(v.parameters)
    if ratio is None or parts is None:
        return None
    ratio = ratio[v.amplitudes]
    own = {c: [x @ ratio[:, None] for x in some] for c, some in parts.items()}
    size = _size(along, own)
    return (
        Item(columns.add(own), 1 / size, np.zeros(1, bool), label=replace(v, together=ratio))
        if size[0] > 1e-12
        else None
    )


def lagging(along: ColumnSource, parts: Mapping[int, Sequence[Array]], columns: CandidateColumns) -> Item:
    """What a law adds if it is early or late: the first two derivatives by time of each of its columns.

    The item's spreads scale each derivative to the law, where the law is scaled to its channel's torque."""
    own: dict[int, list[Array]] = {}
    for c, recordings in parts.items():
        own[c] = []
        for e, x in zip(along.instruments, recordings, strict=True):
            first, second = np.zeros_like(x), np.zeros_like(x)
            for s in e.motion.band_segments():
                if s.stop - s.start > 2:
                    first[s] = np.gradient(x[s], axis=0)
                    second[s] = np.gradient(first[s], axis=0)
            own[c].append(np.hstack([first, second]))
    sizes = _size(along, own)
    return Item(columns.add(own), 1 / np.maximum(sizes, 1e-12), np.zeros(len(sizes), bool))


def _grid(assembly: TorqueModel, p: PlacedEffect) -> tuple[list[EffectVariant], bool]:
    """Points of an effect's grid, and whether a slope to its neighbours may ride along with each.

    A law of one shape without hidden state is cheap: the grid gets a point between every two.
    """
    grid = variants(assembly, p)
    shapes = [i for i, x in enumerate(p.effect.parameters) if len(x.grid) > 1]
    alone = len(shapes) == 1 and len(grid[0].amplitudes) > 0
    if p.effect.at != "joint" or p.effect.states or not alone:
        return grid[:: -(-len(grid) // MOST_GRID)], alone and p.effect.at != "joint"
    i = shapes[0]
    finer = [grid[0]]
    for a, b in pairwise(grid):
        middle = a.parameters.copy()
        one, other = a.parameters[i], b.parameters[i]
        # Periods are halved between by their number in the travel; a place may be zero, or on either side of it.
        middle[i] = 2 / (1 / one + 1 / other) if one * other > 0 else 0.5 * (one + other)
        finer += [replace(a, parameters=middle), b]
    return finer, True


def _about_peaks(assembly: TorqueModel, p: PlacedEffect, peaks: Peaks) -> list[EffectVariant]:
    """A law at each peak of a periodogram, between the trials before and after it."""
    v = variants(assembly, p)[0]
    at = [x.periodic_over != "" for x in p.effect.parameters]
    waves = (peaks.waves[:, None] + peaks.step * np.array([-1, 0, 1])).ravel()
    return [replace(v, parameters=np.where(at, 1 / w, v.parameters)) for w in waves]


def _fitted(along: ColumnSource, p: PlacedEffect, columns: CandidateColumns) -> Item | None:
    """A law at the parameters that it was fitted to by itself, and what each parameter's own size more would add."""
    none = np.zeros(0, int)
    v = EffectVariant(p, along.tuned[p.key], none, np.zeros(1), np.full(1, MOST_OF_WHOLE))
    parts = _made(along, v)
    size = None if parts is None else _size(along, parts)
    if parts is None or size is None or size[0] <= 1e-12:
        return None
    every = {c: [[x] for x in own] for c, own in parts.items()}
    for i in np.flatnonzero(v.parameters):
        changed = v.parameters.copy()
        changed[i] *= 1 + SMALL_STEP
        other = _made(along, replace(v, parameters=changed))
        if other is not None:
            for c, own in every.items():
                for some, x, y in zip(own, parts[c], other[c], strict=True):
                    some.append((y - x) / SMALL_STEP)
    for c, own in starts(along, p, v.parameters).items():
        for some, x in zip(every[c], own, strict=True):
            some.append(x)
    index = columns.add({c: [np.hstack(some) for some in own] for c, own in every.items()})
    return Item(index, np.full(len(index), 1 / size[0]), np.arange(len(index)) == 0, label=v)


def starts(along: ColumnSource, p: PlacedEffect, parameters: Array) -> dict[int, list[Array]]:
    """What a law adds where it starts off rest, by channel: columns (n_band, k) of each recording, those of the others
    zero there; none of a law that always starts at rest."""
    if not springs_back(p):
        return {}
    own = [
        dict(free_responses(along.assembly, e, s, p, parameters))
        for e, s in zip(along.instruments, along.states, strict=True)
    ]
    counts = [next(iter(x.values())).shape[1] if x else 0 for x in own]
    found: dict[int, list[Array]] = {}
    for i, some in enumerate(own):
        for c, x in some.items():
            rows = found.setdefault(c, [np.zeros((len(e.measured), sum(counts))) for e in along.instruments])
            rows[i][:, sum(counts[:i]) : sum(counts[: i + 1])] = x
    return found


def _made(along: ColumnSource, v: EffectVariant) -> dict[int, list[Array]] | None:
    """Columns of a point by channel, one array a recording; None where the law cannot be simulated there."""
    parts: dict[int, list[Array]] = {}
    added = along.assembly.at(v.placed).masses(v.parameters)
    added = None if added is None else added[v.amplitudes]
    for e, s in zip(along.instruments, along.states, strict=True):
        try:
            found = candidate_columns(along.assembly, e, s, v)
        except InputError:
            return None  # a spring whose link has no inertia: no candidate ends a run
        for c, x in found:
            scale = by_mass(along.assembly, e, c)
            kept = x if scale is None or added is None else x + np.outer(scale, added)
            parts.setdefault(c, []).append(kept)
    complete = all(len(x) == len(along.instruments) for x in parts.values())
    finite = all(np.isfinite(x).all() for own in parts.values() for x in own)
    return parts if parts and complete and finite else None


def _size(along: ColumnSource, parts: Mapping[int, Sequence[Array]]) -> Array:
    """RMS of each column over the training recordings, in the RMS torque of the channel that it shows most on."""
    sizes = [
        np.sqrt(np.mean(np.concatenate(list(own[: along.n_train])) ** 2, axis=0)) / along.scale[c]
        for c, own in parts.items()
    ]
    return np.max(sizes, axis=0)
