"""Columns that stand beside every explanation: the fit's own parameters, and every nuisance (`beside`)."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..deciding import BASELINE, BASELINE_OWN, BASELINE_SHAPE
from ..evidence.pool import CandidateColumns, Curves
from ..evidence.weighed import NuisanceColumns, Part
from ..fitting.fit import Fit
from ..fitting.problem import gather
from .beside import nuisances
from .beside._block import FitContext
from .hypotheses import ColumnSource
from .laws import shapes

Array = NDArray[np.float64]


def columns_beside(
    along: ColumnSource,
    found: Fit,
    by_words: Curves,
    columns: CandidateColumns,
    nameless: Mapping[tuple[int, str], float],
) -> NuisanceColumns:
    """All nuisance columns of some recordings under a fit; ``nameless`` curves have their own sizes."""
    assembly, n, n_channels = found.assembly, along.n_train, len(along.scale)
    derivatives = [assembly.residual(e, found.theta)[1] for e in along.instruments]
    baseline = [
        [_filled(gather(b, c), len(e.measured)) for c in range(n_channels)]
        for b, e in zip(derivatives, along.instruments, strict=True)
    ]
    spread = _spread(found, baseline[:n], along.scale)
    parts: list[list[list[Part]]] = [[[(index, x * spread[index])] for index, x in row] for row in baseline]
    noise_beside = [[[x] for _, x in row] for row in baseline]
    count = len(found.theta)
    tolerant = slice(count, count)
    context = FitContext(along, found, baseline, by_words, columns, nameless)
    for block in (x for nuisance in nuisances() for x in nuisance(context)):
        if block.tolerated:
            tolerant = slice(count, count + block.count)
        for row, own in zip(parts, block.parts, strict=True):
            for c, (at, x) in own.items():
                row[c].append((count + at, x))
        for row, loud in zip(noise_beside, block.noise_beside, strict=False):
            for c, x in loud.items():
                row[c].append(x)
        count += block.count
    joined = [[_joined(own) for own in row] for row in parts]
    return NuisanceColumns(joined, count, tolerant, [[np.hstack(own) for own in row] for row in noise_beside], spread)


def _filled(part: Part, n: int) -> Part:
    index, x = part
    return (index, x) if len(index) else (index, np.zeros((n, 0)))


def _joined(own: Sequence[Part]) -> Part:
    return np.concatenate([index for index, _ in own]), np.concatenate([x for _, x in own], axis=1)


def _spread(found: Fit, baseline: Sequence[Sequence[Part]], scale: Array) -> Array:
    """Prior deviation of each of the baseline's parameters about its fit (P,)."""
    size = np.zeros(len(found.theta))
    for c in range(len(scale)):
        index = baseline[0][c][0]
        if len(index):
            rms = np.sqrt(np.mean(np.concatenate([row[c][1] for row in baseline]) ** 2, axis=0))
            np.maximum.at(size, index, rms / scale[c])
    own = np.abs(found.theta)
    spread = np.where(size > 0, BASELINE_OWN * own + BASELINE / np.maximum(size, 1e-12), 0.0)
    return np.where(shapes(found.assembly), np.minimum(spread, BASELINE_SHAPE * own), spread)
