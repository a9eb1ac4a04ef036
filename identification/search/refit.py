"""A model fitted again with more or fewer effects, from its last fit."""

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
"""Product of the channels' ratios of residuals, with something more and without, that no good optimum has."""


def assemble(model: Model, base: BaseParameters | None, scales: Mapping[str, Scales]) -> TorqueModel:
    """Parameters and torque of a model, started from the values it has."""
    return TorqueModel(model.tree, model.effects, base, scales, model.values)


def refitted(before: Fit, assembly: TorqueModel, samples: Sequence[Experiment], everywhere: bool, seed: int) -> Fit:
    """The fit of a model with more effects; from many starts if that is asked for, or if the fit ended in a bad
    optimum.

    The model before is a special case, so that the new fit leaves no larger residual, unless it ended in a bad optimum.
    """
    found = fit(assembly, samples, start=carry(before, assembly), multi_start=everywhere, seed=seed)
    if everywhere or not _less_likely(found, before, samples):
        return found
    return fit(assembly, samples, start=carry(before, assembly), multi_start=True, seed=seed)


def _less_likely(found: Fit, case: Fit, samples: Sequence[Experiment]) -> bool:
    """Whether a fit ended in a bad optimum: it explains all channels together less well than the fit of a special case.

    With the noise of each channel estimated, the likelihood is the product of the channels' residuals: one may end
    above the case's where others end far below.
    """
    with_it, without_it = (channel_rms(f.assembly, samples, f.theta)[0] for f in (found, case))
    ratio = float(np.sum(np.log(np.maximum(with_it, 1e-300) / np.maximum(without_it, 1e-300))))
    return not ratio <= np.log(WORSE)


def carry(found: Fit, assembly: TorqueModel) -> Array:
    """A fit's parameters in another assembly's order; new parameters start where that assembly says."""
    known = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    return np.array([known.get(s.key, s.start) for s in assembly.slots])


def without(found: Fit, keys: Sequence[str], experiments: Sequence[Experiment], case: Fit) -> Fit:
    """The fit of a model without some of its effects, from its last fit.

    ``case`` is the fit of a special case of what is left: where that explains more, from there and from many starts.
    """
    assembly = found.assembly.keep([p for p in found.assembly.placed if p.key not in set(keys)], found.theta)
    samples = fitted(assembly, experiments)
    rest = fit(assembly, samples, start=carry(found, assembly), multi_start=False)
    if not _less_likely(rest, case, samples):
        return rest
    return fit(assembly, samples, start=carry(case, assembly), multi_start=True)
