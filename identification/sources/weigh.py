"""Recordings under a fit, as the evidence sees them: channels with their noise, and every hypothesis."""

import functools
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..deciding import DISCREPANCY, LAW_ERROR
from ..evidence.evidence import Evidence, ResidualChannel
from ..evidence.pool import CandidateColumns, Item
from ..evidence.prior import pool
from ..evidence.projected import ProjectedEvidence
from ..evidence.search import Search
from ..evidence.weighed import NuisanceColumns, WeighedRecordings, principal
from ..nuisance.curve import SMALL
from ..nuisance.learn import learn
from ..nuisance.noise import Noise
from .fit import Covariances, fit, priors
from .source import GridPoint, Linearisation, ModelPoint, Source

Array = NDArray[np.float64]

PointKey = tuple[str, tuple[tuple[str, float], ...]]
"""Of a point of an effect's grid: the effect's key, and each parameter's key and value."""

STRONGEST = 10
"""Directions of what could explain a residual beside which its noise is learnt."""


def covariances(weighed: WeighedRecordings) -> Covariances:
    """Covariances of every recording and channel."""
    return [[channel.covariance for channel in row] for row in weighed.evidence.channels]


def weigh(
    source: Source,
    numbers: Sequence[int],
    given: ModelPoint,
    linear: Linearisation,
    known: WeighedRecordings | None = None,
    *,
    search: bool,
    alone: Mapping[str, GridPoint] | None = None,
    only: Container[PointKey] | None = None,
    nameless: Mapping[tuple[int, str], float] | None = None,
) -> WeighedRecordings:
    """Recordings under a fit.

    Parameters
    ----------
    source : Source
    numbers : sequence of int
        Recordings, those for training first.
    given : ModelPoint
        The model as given.
    linear : Linearisation
        The fit on these recordings.
    known : WeighedRecordings, optional
        Has the noise, which is learnt without it.
    search : bool
        False leaves out all hypotheses: only the evidence of the fit itself is wanted.
    alone : mapping of str to GridPoint, optional
        Laws that were fitted by themselves, by their key: a point more of their grid.
    only : container, optional
        Points of the effects' grids (`point_key`), where not all are wanted.
    nameless : mapping of (channel, words) to float, optional
        Sizes of nameless curves that stand beside every explanation.
    """
    columns, scale = CandidateColumns([len(r) for r in linear.residuals]), source.scale()
    named = _named(source, numbers, linear.at, columns, alone or {}, only) if search else {}
    spread = np.concatenate([_spread(source, given, linear.at), np.ones(len(linear.at.shifts))])
    nameless = nameless or {}
    curves = {k: x for k, x in source.curves(numbers).items() if search or k[1] in SMALL or k in nameless}
    sizes = {k: _rms_of_curve(x[: len(source.train)]) for k, x in curves.items()}
    small = {k: [x / sizes[k] for x in own] for k, own in curves.items() if k[1] in SMALL or k in nameless}
    laws = [[columns.some(i, c, columns.of(i, c)[0]) for i in range(len(numbers))] for c in range(len(scale))]

    def could(c: int, named: bool) -> list[Array]:
        parts = []
        for i, x in enumerate(linear.columns):
            own = [x[:, c] * spread, *(curve[i] for (at, _), curve in small.items() if at == c)]
            parts.append(np.concatenate([*own, laws[c][i]] if named else own, axis=1))
        return principal(parts, STRONGEST)

    beside_laws = [could(c, True) for c in range(len(scale))] if known is None else []
    runs = source.noise_channels(numbers, linear, beside_laws) if known is None else known.runs

    def noise(c: int, beside: Sequence[Array], missing: Sequence[Array] = ()) -> Noise:
        n = len(source.train)
        own, left = [row[c] for row in runs[:n]], [r[:, c] for r in linear.residuals[:n]]
        left = [r - x for r, x in zip(left, missing, strict=True)] if missing else left
        return learn(left, beside[:n], own, channels=len(runs[0]))

    noises = [noise(c, x) for c, x in enumerate(beside_laws)] if known is None else known.noises
    by_words = {}
    for (c, words), x in curves.items() if search else ():
        k = x[0].shape[1]
        by_words[c, words] = Item(columns.add({c: x}), np.full(k, scale[c] / sizes[c, words]), np.zeros(k, bool),
                                  label=(c, words))  # fmt: skip
    count = linear.columns[0].shape[2]
    placed = slice(len(linear.at.values), count)
    known_shifts = np.concatenate([np.zeros(len(linear.at.values)), linear.at.shifts])
    wrong = [_wrong(source, linear, c) for c in range(len(scale))]
    beside: list[list[tuple[NDArray[np.int_], Array]]] = []
    total = count + sum(x[0].shape[1] for x in small.values())
    for i, x in enumerate(linear.columns):
        row, start = [], count
        for c in range(len(scale)):
            index, parts = [np.arange(count)], [x[:, c] * spread]
            for (at, words), curve in small.items():
                if at == c:
                    size = np.hypot(wrong[c] if words in SMALL else 0.0, nameless.get((c, words), 0.0))
                    index.append(start + np.arange(curve[i].shape[1]))
                    parts.append(curve[i] * size * scale[c])
                    start += curve[i].shape[1]
            row.append((np.concatenate(index), np.concatenate(parts, axis=1)))
        beside.append(row)
    channels = [
        [
            # The shifts' prior is about what the set-up is said to be, not about where they now are.
            ResidualChannel(r[:, c] + x[:, c] @ known_shifts, noises[c].covariance(row_of[c]), *row[c])
            for c in range(len(scale))
        ]
        for r, x, row_of, row in zip(linear.residuals, linear.columns, runs, beside, strict=True)
    ]
    hypotheses = tuple(pool(named, by_words, ())) if named or by_words else ()
    items = [item for h in hypotheses for item in h.items]
    evidence = Evidence(channels, columns, items, total)
    tolerant = slice(placed.start, placed.stop if source.anew else placed.start)
    others = NuisanceColumns([], total, tolerant, [], spread, (1.0,))

    @functools.cache
    def bare(c: int) -> Noise:
        return noise(c, could(c, False))

    def noise_of_rest(c: int, missing: Sequence[Array]) -> Noise:
        return noise(c, could(c, False), missing)

    return WeighedRecordings(
        evidence, hypotheses, tuple(noises), others, scale, len(source.train), runs, bare, noise_of_rest
    )


def opened(
    source: Source, given: ModelPoint, here: Linearisation, known: WeighedRecordings | None = None
) -> WeighedRecordings:
    """The training recordings under a fit with every hypothesis; laws without amplitudes are fitted by themselves."""
    weighed = weigh(source, source.train, given, here, known, search=True)
    if not any(h.named and h.items[0].whole for h in weighed.pool):
        return weighed
    own = by_themselves(source, given, here, weighed)
    return weigh(source, source.train, given, here, known or weighed, search=True, alone=own)


def by_themselves(
    source: Source, given: ModelPoint, linear: Linearisation, weighed: WeighedRecordings
) -> dict[str, GridPoint]:
    """Every law without amplitudes, fitted by itself from the best point of its grid: between grid points it explains
    much less.
    """
    on, found = ProjectedEvidence(weighed.evidence, range(len(source.train))), {}
    best = Search(on, weighed.pool).scan([]).item
    for h, x in enumerate(weighed.pool):
        if x.named and x.items[0].whole:
            v: GridPoint = weighed.evidence.items[best[h]].label
            at = linear.at.with_effects([v.placed], v.values)
            # What is there moves little beside it: its columns are those of its own fit.
            fitted = fit(source, given, at, covariances(weighed)[: len(source.train)], linear.columns)
            found[x.key] = replace(v, values={k: fitted.at.all_values[k] for k in v.values})
    return found


def point_key(v: GridPoint) -> PointKey:
    """What tells a point of an effect's grid from every other."""
    return v.placed.key, tuple(sorted(v.values.items()))


def _named(
    source: Source,
    numbers: Sequence[int],
    at: ModelPoint,
    columns: CandidateColumns,
    alone: Mapping[str, GridPoint],
    only: Container[PointKey] | None,
) -> dict[str, tuple[PlacedEffect, list[Item]]]:
    """Every effect that is not there, with its columns at each point of its grid."""
    grids = [(p, [v for v in source.variants(p) if only is None or point_key(v) in only])
             for p in source.library(at.placed)]  # fmt: skip
    every = [v for _, grid in grids for v in grid]
    own = [source.columns(i, at, every) for i in numbers]
    parts = iter(zip(*own, strict=True))
    found: dict[str, tuple[PlacedEffect, list[Item]]] = {}
    for p, grid in grids:
        items = [_item(source, columns, v, next(parts)) for v in grid]
        if p.key in alone and (only is None or point_key(alone[p.key]) in only):
            items.append(_fitted(source, numbers, at, columns, alone[p.key]))
        some = [x for x in items if x is not None]
        if some:
            found[p.key] = (p, some)
    return found


def _item(source: Source, columns: CandidateColumns, v: GridPoint, parts: Sequence[Array]) -> Item | None:
    size = _size(source, parts)
    if not _finite(parts) or np.any(size <= 0):
        return None
    index = _added(columns, parts)
    if not v.amplitudes:
        return Item(index, np.ones(1), np.ones(1, bool), True, replace(v, size=float(size[0])))
    named = {x.name: x for x in v.placed.effect.parameters}
    positive = np.array([named[k.rpartition(".")[2]].low >= v.origin.get(k, 0.0) for k in v.amplitudes])
    return Item(index, np.full(len(size), v.size) if v.size else 1 / size, positive, label=v)


def _fitted(
    source: Source, numbers: Sequence[int], at: ModelPoint, columns: CandidateColumns, v: GridPoint
) -> Item | None:
    """A law where it was fitted by itself, and what each parameter's own size more would add: no more than the law."""
    there, parts = at.with_effects([v.placed], v.values).held(len(at.values)), []
    for i in numbers:
        here = source.predicted(i, there)
        if here is None:
            return None
        (law,) = source.columns(i, at, [v])
        parts.append(np.concatenate([law, source.slopes(i, there, here) * there.values], axis=2))
    size = _size(source, parts)
    if not _finite(parts) or size[0] <= 0:
        return None
    index = _added(columns, parts)
    return Item(index, 1 / np.maximum(size, size[0]), np.arange(len(index)) == 0, label=v)


def _finite(parts: Sequence[Array]) -> bool:
    """Can every recording be predicted with an effect?"""
    return all(bool(np.all(np.isfinite(x))) for x in parts)


def _size(source: Source, parts: Sequence[Array]) -> Array:
    """RMS of each column over the training recordings, as a share of the channel that it shows most on (k,)."""
    whole = np.concatenate(parts[: len(source.train)])
    return np.max(np.sqrt(np.mean(whole**2, axis=0)) / source.scale()[:, None], axis=0)


def _added(columns: CandidateColumns, parts: Sequence[Array]) -> NDArray[np.int_]:
    """Columns entered on every channel that they reach."""
    reached = np.any([np.any(x, axis=(0, 2)) for x in parts], axis=0)
    return columns.add({int(c): [x[:, c] for x in parts] for c in np.flatnonzero(reached)})


def _spread(source: Source, given: ModelPoint, at: ModelPoint) -> Array:
    """Prior deviation of the free parameters (P,)."""
    _, own = priors(source, given, at)
    return np.where(np.isfinite(own), own, np.maximum(np.abs(at.values), 1e-12))


def _rms_of_curve(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([np.sum(x**2, axis=1) for x in parts])))) or 1.0


def _wrong(source: Source, linear: Linearisation, c: int) -> float:
    """How large the small curves are beside every explanation [share of the channel]: no law of the model is exact."""
    n = len(linear.at.values)
    laws = [x[:, c, :n] @ linear.at.values for x in linear.columns[: len(source.train)]]
    share = float(np.sqrt(np.mean(np.concatenate([x - x.mean() for x in laws]) ** 2))) / source.scale()[c]
    return float(np.hypot(DISCREPANCY, LAW_ERROR * share))
