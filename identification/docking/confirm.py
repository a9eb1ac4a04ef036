"""Confirm on the held-out docking what a search named: log density of it given the others, with and without each name.

As in `evidence.confirm`: without an effect the rest is fitted again, and both foretell the held-out recordings, every
nuisance integrated out. A name stays if that density falls without it by more than it scatters over blocks of time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..deciding import BLOCK, GATE
from ..evidence.confirm import scatter
from ..evidence.evidence import Projected
from .fit import Linear, fit, linearised, shift_columns
from .recording import EVERY
from .runs import Runs
from .search import Found, Name
from .weigh import Weighed, channel_scale, covariances, hangs, weigh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Missed:
    """What the held-out recordings lose without an effect: log density and its scatter; the fit without it, on the
    training and on the held-out recordings."""

    gain: float
    scatter: float
    train: Linear
    held: Linear

    @property
    def sure(self) -> float:
        """The gain in units of its scatter."""
        return self.gain / max(self.scatter, 1e-12)


@dataclass(frozen=True)
class Confirmed:
    """Names that stay and what the held-out recordings miss of each, those that do not, and the last fit."""

    names: tuple[Name, ...]
    missed: dict[str, Missed]
    rejected: tuple[Name, ...]
    train: Linear
    held: Linear


def confirm(
    runs: Runs,
    train: Sequence[int],
    held: Sequence[int],
    model: Model,
    found: Found,
    progress: Callable[[str], None] = lambda _: None,
) -> Confirmed:
    """Take out the name that the held-out recordings miss least, until they miss every one."""
    last, names = found.last, list(found.names)
    shifted = shift_columns(last)
    progress("confirming on the held-out recording")
    there = linearised(runs, held, last.at)
    beside = shift_columns(there)
    rejected: list[Name] = []
    noise = covariances(found.weighed)
    there_records = [runs.records[i] for i in held]
    could = [[x[:, c] for x in there.columns] for c in range(len(there_records[0].channels))]
    own = hangs(there_records, there, could, channel_scale(runs, train))
    noise_of = replace(found.weighed, hangs=(*found.weighed.hangs, *own))
    while True:
        whole = _foretold(runs, train, held, model, last, there, noise_of)
        missed: dict[str, Missed] = {}
        for name in names:
            key = name.placed.key
            rest = fit(runs, train, model, last.at.without(key), noise, shifted)
            other = linearised(runs, held, rest.at, beside)
            density, blocks = _foretold(runs, train, held, model, rest, other, noise_of)
            missed[key] = Missed(whole[0] - density, scatter(0.5 * (blocks - whole[1])), rest, other)
        weakest = min(names, key=lambda n: missed[n.placed.key].sure, default=None)
        if weakest is None or missed[weakest.placed.key].sure > GATE:
            return Confirmed(tuple(names), missed, tuple(rejected), last, there)
        names.remove(weakest)
        rejected.append(weakest)
        last, there = missed[weakest.placed.key].train, missed[weakest.placed.key].held


def _foretold(
    runs: Runs, train: Sequence[int], held: Sequence[int], model: Model, here: Linear, there: Linear, known: Weighed
) -> tuple[float, Array]:
    """Log density of the held-out recordings given the training ones, and what each block of time takes off it."""
    both = Linear(here.at, (*here.residuals, *there.residuals), (*here.columns, *there.columns))
    evidence = weigh(runs, [*train, *held], model, both, known, search=False).evidence
    n = len(train)
    learnt = Projected(evidence, range(n)).posterior(evidence.n_always)
    on = Projected(evidence, range(n, n + len(held)), None, learnt)
    always = on.beside([])
    count = max(round(BLOCK / EVERY), 1)
    parts = []
    for i in range(n, n + len(held)):
        own = evidence.left(i, always, [])
        parts.append(np.array([b.sum() for b in np.array_split(own, max(len(own) // count, 4))]))
    return on.null, np.concatenate(parts)
