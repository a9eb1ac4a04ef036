"""Recordings of dockings under a fit, as the evidence sees them: channels with their noise, and every hypothesis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...models.docking.bench_setup import docking_effects
from ...models.effects import get_effect
from ...models.model import Model, Placed
from ..deciding import LEAST_LEVEL, STICKS
from ..evidence.evidence import Channel, Evidence
from ..evidence.hypotheses import pool
from ..evidence.pool import Columns, Hypothesis, Item
from ..nuisance.noise import Noise, Run, learn
from .fit import Covariances, Linear, priors
from .recording import EVERY, KNOTS, Record
from .runs import SHIFTS, Runs

Array = NDArray[np.float64]

STRONGEST = 10
"""Directions of what could explain a residual beside which its noise is learnt."""


ABOUT = 3
"""Windows either way over which what nothing explains is averaged: 0.3 s, a touch and its rebound."""


@dataclass(frozen=True)
class Variant:
    """An effect at one point of its grid: values by key, and the parameters that each column is in proportion to."""

    placed: Placed
    values: Mapping[str, float]
    amplitudes: tuple[str, ...]


@dataclass(frozen=True)
class Weighed:
    """Evidence of some recordings under a fit, the hypotheses, the noise of every channel, and the fit."""

    evidence: Evidence
    pool: tuple[Hypothesis, ...]
    noises: tuple[Noise, ...]
    hangs: tuple[list[Run], ...]
    """What the noise of every channel of every recording hangs on."""
    linear: Linear


def library(placed: Sequence[Placed]) -> list[Placed]:
    """Every effect at every place that is not there yet."""
    have = {p.key for p in placed}
    every = [Placed(get_effect(name), at) for name, places in docking_effects().items() for at in places]
    return [p for p in every if p.key not in have]


def variants(placed: Placed) -> list[Variant]:
    """Points of an effect's grid. A parameter that is zero where there is no effect is an amplitude."""
    parameters = placed.effect.parameters
    amplitudes = [x for x in parameters if x.zero == 0]
    shapes = [x for x in parameters if x.zero != 0]
    found = []
    for shape in product(*(x.grid for x in shapes)):
        for k in range(max(len(x.grid) for x in amplitudes)):
            values = {f"{placed.key}.{x.name}": v for x, v in zip(shapes, shape, strict=True)}
            values |= {f"{placed.key}.{x.name}": x.grid[k % len(x.grid)] for x in amplitudes}
            found.append(Variant(placed, values, tuple(f"{placed.key}.{x.name}" for x in amplitudes)))
    return found


def channel_scale(runs: Runs, numbers: Sequence[int]) -> Array:
    """RMS of each channel (c,) since the start."""
    every = np.concatenate([runs.records[i].measured - runs.records[i].measured[0] for i in numbers])
    return np.maximum(np.sqrt(np.nanmean(every**2, axis=0)), 1e-12)


def candidates(
    runs: Runs, numbers: Sequence[int], linear: Linear, columns: Columns, scale: Array
) -> dict[str, tuple[Placed, list[Item]]]:
    """Every effect that is not there, with a column for each amplitude at each point of its grid: what the simulation
    changes by, from there being none of it."""
    base, at = {}, linear.at
    for i in numbers:
        base[i] = runs(i, at.all_values, at.shifts)
    found: dict[str, tuple[Placed, list[Item]]] = {}
    for p in library(at.placed):
        items: list[Item] = []
        for v in variants(p):
            shape = {k: x for k, x in v.values.items() if k not in v.amplitudes}
            parts: list[list[Array]] = [[] for _ in numbers]
            for key in v.amplitudes:
                for own, i in zip(parts, numbers, strict=True):
                    seen = runs(i, {**at.all_values, **shape, key: v.values[key]}, at.shifts)
                    none = base[i]
                    assert none is not None
                    own.append((np.full_like(none, np.nan) if seen is None else seen - none) / abs(v.values[key]))
            whole = [np.stack(own, axis=2) for own in parts]
            size = np.max(np.sqrt(np.mean(np.concatenate(whole) ** 2, axis=0)) / scale[:, None], axis=0)
            if not np.all(np.isfinite(size)) or np.any(size <= 0):
                continue
            signs = np.array([np.sign(v.values[k]) for k in v.amplitudes])
            named = {x.name: x for x in p.effect.parameters}
            positive = np.array([named[k.rpartition(".")[2]].low >= 0 for k in v.amplitudes])
            index = columns.add({c: [x[:, c] * signs for x in whole] for c in range(len(scale))})
            items.append(Item(index, 1 / size, positive, label=v))
        if items:
            found[p.key] = (p, items)
    return found


def weigh(
    runs: Runs, numbers: Sequence[int], model: Model, linear: Linear, known: "Weighed | None" = None, *, search: bool
) -> Weighed:
    """Recordings under a fit; ``known`` has the noise, which is learnt without it, and ``search`` False leaves out all
    hypotheses."""
    records = [runs.records[i] for i in numbers]
    columns = Columns([len(r.measured) for r in records])
    scale = channel_scale(runs, numbers)
    named = candidates(runs, numbers, linear, columns, scale) if search else {}
    spread = _spread(model, linear)
    if known is None:
        could = [
            _strongest(
                [
                    np.concatenate([x[:, c] * spread, *([columns.of(i, c)[1]] if named else [])], axis=1)
                    for i, x in enumerate(linear.columns)
                ]
            )
            for c in range(len(scale))
        ]
        own = hangs(records, linear, could, scale)
        noises = tuple(
            learn([r[:, c] for r in linear.residuals], could[c], [row[c] for row in own]) for c in range(len(scale))
        )
    else:
        own, noises = known.hangs, known.noises
    index = np.arange(linear.columns[0].shape[2])
    shifts = np.concatenate([np.zeros(len(linear.at.values)), linear.at.shifts])
    channels = [
        [
            # The shifts' prior is about what the set-up is said to be, not about where they now are.
            Channel(r[:, c] + x[:, c] @ shifts, noises[c].covariance(row[c]), index, x[:, c] * spread)
            for c in range(len(scale))
        ]
        for r, x, row in zip(linear.residuals, linear.columns, own, strict=True)
    ]
    hypotheses = tuple(pool(named, {}, ())) if named else ()
    items = [item for h in hypotheses for item in h.items]
    return Weighed(Evidence(channels, columns, items, len(index)), hypotheses, tuple(noises), tuple(own), linear)


def covariances(weighed: Weighed) -> Covariances:
    """Of every recording and channel."""
    return [[channel.covariance for channel in row] for row in weighed.evidence.channels]


def _spread(model: Model, linear: Linear) -> Array:
    """Prior deviation of what always stands beside (P + S,)."""
    _, own = priors(model, linear.at)
    values = np.abs(linear.at.values)
    return np.concatenate([np.where(np.isfinite(own), own, np.maximum(values, 1e-12)), np.ones(len(SHIFTS))])


def touching(record: Record, seen: Array) -> NDArray[np.bool_]:
    """Windows (n,) in which balls touch and slide, and those about them: the load on the target changes fast."""
    change = _change(seen)
    loads = [c for c, name in enumerate(record.channels) if name.startswith(("force.", "torque."))]
    fast = change[:, loads or range(len(record.channels))].max(axis=1) > STICKS[0][0]
    return np.logical_or.reduce([np.roll(fast, k) for k in (-1, 0, 1)])


def standing(record: Record) -> NDArray[np.bool_]:
    """Windows (n,) in which the carriage stands, and takes any force up to its friction."""
    rate = record.motion.rate[::KNOTS]
    slowest = np.minimum(np.abs(rate[1:]), np.abs(rate[:-1]))
    return (slowest < STICKS[0][0] * np.abs(rate).max()) | (rate[1:] * rate[:-1] < 0)


def hangs(
    records: Sequence[Record], linear: Linear, could: Sequence[Sequence[Array]], scale: Array
) -> tuple[list[Run], ...]:
    """What the noise of every channel hangs on.

    While balls touch and slide no law of contact tells the load to the window: a channel may then be off, as a joint
    near rest may hold any torque, by what nothing explains there, in the RMS over `ABOUT` windows either way, and by
    `LEAST_LEVEL` of its size at least, a vector's of the largest of its axes. A motor whose carriage stands may hold
    anything up to its friction. Where a channel changes fast it may be off by more, which the noise learns.

    Parameters
    ----------
    records : sequence of Record
    linear : Linear
        Their residuals.
    could : sequence of sequence of array (n, k)
        What could explain each channel's of each.
    scale : array (c,)
    """
    seen = [np.nan_to_num(r.measured) - left for r, left in zip(records, linear.residuals, strict=True)]
    kinds = [name.rpartition(".")[0] for name in records[0].channels]
    least = [LEAST_LEVEL * max(x for x, other in zip(scale, kinds, strict=True) if other == kind) for kind in kinds]
    loose = [touching(r, x) for r, x in zip(records, seen, strict=True)]
    found: tuple[list[Run], ...] = tuple([] for _ in records)
    for c, name in enumerate(records[0].channels):
        driven = name.startswith(("tau.", "tension."))
        rows = [(standing(r) & (name == "tau.carriage")) if driven else k for r, k in zip(records, loose, strict=True)]
        left = np.concatenate([r[k, c] for r, k in zip(linear.residuals, rows, strict=True)])
        columns = np.concatenate([x[k] for x, k in zip(could[c], rows, strict=True)])
        if len(left) > 2 * columns.shape[1]:
            left = left - columns @ np.linalg.lstsq(columns, left, rcond=1e-6)[0]
            left *= np.sqrt(len(left) / (len(left) - columns.shape[1]))
        ends = np.cumsum([k.sum() for k in rows])[:-1]
        for own, part, k, x in zip(found, np.split(left, ends), rows, seen, strict=True):
            energy, count = np.zeros(len(k)), np.convolve(k, np.ones(2 * ABOUT + 1), "same")
            energy[k] = part**2
            energy = np.convolve(energy, np.ones(2 * ABOUT + 1), "same") / np.maximum(count, 1)
            sticks = np.where(k, np.maximum(np.sqrt(energy), least[c]), 0.0)
            n = len(k)
            own.append(Run(EVERY, (slice(0, n),), np.zeros(n), (sticks,), _change(x)[:, c], 1.0))
    return found


def _change(seen: Array) -> Array:
    """How fast each channel changes (n, c), as a share of its fastest."""
    rates = np.abs(np.gradient(seen, axis=0))
    return rates / np.maximum(rates.max(axis=0), 1e-300)


def _strongest(parts: Sequence[Array]) -> list[Array]:
    """The strongest directions of columns of unit RMS, of unit RMS themselves."""
    whole = np.concatenate(list(parts))
    size = np.sqrt(np.mean(whole**2, axis=0))
    use = size > 1e-9 * size.max(initial=1e-300)
    u, d, _ = np.linalg.svd(whole[:, use] / size[use], full_matrices=False)
    kept = u[:, (np.arange(len(d)) < STRONGEST) & (d > 1e-3 * d.max(initial=0.0))] * np.sqrt(len(u))
    return np.split(kept, np.cumsum([len(p) for p in parts])[:-1])
