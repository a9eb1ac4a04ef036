"""A model fitted again, with something more or something less, from where it was."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..fitting.assembly import TorqueModel
from ..fitting.base_parameters import BaseParameters
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit, channel_rms, fit
from .rest import fitted

Array = NDArray[np.float64]

WORSE = 1.05
"""Ratio of a channel's residuals, with something more and without, that no good optimum has."""


def assemble(model: Model, base: BaseParameters | None, scales: Mapping[str, Scales]) -> TorqueModel:
    """Parameters and torque of a model, started from the values it has."""
    return TorqueModel(model.tree, model.effects, base, scales, model.values)


def refitted(before: Fit, assembly: TorqueModel, samples: Sequence[Experiment], everywhere: bool, seed: int) -> Fit:
    """The fit of a model that has something more; from many starts if it was to be, or if one ended badly.

    What it had before is a special case of it, so that it leaves no more, unless it ended in a bad optimum.
    """
    found = fit(assembly, samples, start=carry(before, assembly), multi_start=everywhere, seed=seed)
    if everywhere:
        return found
    with_it, without_it = (channel_rms(f.assembly, samples, f.theta)[0] for f in (found, before))
    if np.all(with_it <= WORSE * without_it):
        return found
    return fit(assembly, samples, start=carry(before, assembly), multi_start=True, seed=seed)


def carry(found: Fit, assembly: TorqueModel) -> Array:
    """A fit's parameters in another assembly's order; what is new there starts where that assembly says."""
    known = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    return np.array([known.get(s.key, s.start) for s in assembly.slots])


def without(found: Fit, keys: Sequence[str], experiments: Sequence[Experiment]) -> Fit:
    """The fit of the same model with some effects taken out of it, from where it was."""
    assembly = found.assembly.keep([p for p in found.assembly.placed if p.key not in set(keys)], found.theta)
    return fit(assembly, fitted(assembly, experiments), start=carry(found, assembly), multi_start=False)
