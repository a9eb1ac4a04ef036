"""A model's own parameters, fitted to the training recordings before anything is searched."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..deciding import ROUNDS
from ..evidence.weighed import WeighedRecordings
from .fit import STILL, fit, kept_columns, linearised, sizes_of
from .source import Linearisation, ModelPoint, Source
from .weigh import covariances, weigh

Array = NDArray[np.float64]

STEPS = 8
"""Most steps of the fit."""


def known(model: Model, start: ModelPoint) -> ModelPoint:
    """What the model file has a value of; of the rest there is no prior."""
    return ModelPoint((), {k: x for k, x in start.all_values.items() if k in model.values}, np.zeros(0), start.shifts)


def fitted(source: Source, given: ModelPoint, start: ModelPoint) -> tuple[WeighedRecordings, Linearisation]:
    """The parameters fitted from a start, with the prior of what is ``given``; and the recordings as weighed."""
    here = linearised(source, source.train, start)
    weighed = weigh(source, source.train, given, here, search=False)
    return refitted(source, given, start, weighed, kept_columns(source, here))


def refitted(
    source: Source, given: ModelPoint, start: ModelPoint, weighed: WeighedRecordings, shifted: Sequence[Array] | None
) -> tuple[WeighedRecordings, Linearisation]:
    """As `fitted`, in noise that is known at the start, with the shifts' ``shifted`` columns (n, c, S) as in `fit`.

    Far from the truth a misfit is taken for noise: where a fit ends the noise is learnt anew, until that moves nothing.
    """
    at = start
    for _ in range(ROUNDS):
        found = fit(source, given, at, covariances(weighed), shifted, STEPS)
        moved = np.abs(found.at.values - at.values) / sizes_of(source, found.at)
        shifted_by = np.abs(found.at.shifts - at.shifts)
        at = found.at
        if np.all(moved < STILL) and np.all(shifted_by < STILL):
            break
        weighed = weigh(source, source.train, given, found, search=False)
    return weighed, found


def settled(
    source: Source, model: Model, start: ModelPoint, progress: Callable[[str], None] = lambda _: None
) -> ModelPoint:
    """Where a search starts: a parameter that the model file has no value of is fitted first."""
    given = known(model, start)
    if len(given.all_values) == len(start.all_values):
        return start
    progress("fitting what the model file has no value of")
    return replace(fitted(source, given, start)[1].at, shifts=start.shifts)
