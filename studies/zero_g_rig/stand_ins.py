"""What a recording could not have told apart: angles between explanations, after friction has taken its part.

Each explanation is a set of columns, the torque it adds per unit of each of its parameters, on all channels in the
analysis band and in units of the channels' noise. Friction is refitted whatever else is wrong, so its columns are
projected out first. Two explanations that a recording cannot tell apart then span nearly the same directions.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import subspace_angles

from ...identification.fitting.assembly import TorqueModel
from ...identification.fitting.experiment import Experiment
from ...identification.fitting.fit import Fit
from ...models.model import PlacedEffect

Array = NDArray[np.float64]

WEAK = 1e-6
"""Share of the largest singular value below which a direction does not count."""


@dataclass(frozen=True)
class StandIns:
    """How well other explanations stand in for one.

    Parameters
    ----------
    name, other : str
    angle : float
        Smallest principal angle between the two spans, friction projected out [degrees].
    mimicked : float
        Share of the first one's energy that the other can take, 0 to 1.
    """

    name: str
    other: str
    angle: float
    mimicked: float


def columns(base: Fit, placed: Sequence[PlacedEffect], experiments: Sequence[Experiment], noise: Array) -> Array:
    """Torque per parameter of an explanation (n_band * J, P), from where friction alone was fitted."""
    values = base.assembly.values(base.theta)
    assembly = TorqueModel(base.assembly.tree, placed, None, base.assembly.scales, values)
    return _stacked(assembly, assembly.start, experiments, noise)


def friction_columns(base: Fit, experiments: Sequence[Experiment], noise: Array) -> Array:
    """Columns of all parameters that the base has fitted."""
    return _stacked(base.assembly, base.theta, experiments, noise)


def compare(
    base: Fit, named: Mapping[str, Sequence[PlacedEffect]], experiments: Sequence[Experiment], noise: Array
) -> list[StandIns]:
    """Every ordered pair of explanations.

    Parameters
    ----------
    base : Fit
        Friction.
    named : mapping of str to sequence of PlacedEffect
        Explanations.
    experiments : sequence of Experiment
    noise : array (J,)
        Noise of each channel [N·m].
    """
    known = _basis(friction_columns(base, experiments, noise))
    spans = {}
    for name, placed in named.items():
        raw = columns(base, placed, experiments, noise)
        spans[name] = raw - known @ (known.T @ raw)
    bases = {name: _basis(x) for name, x in spans.items()}
    found = []
    for a, own in spans.items():
        for b, basis in bases.items():
            if a != b:
                angle = float(np.degrees(np.min(subspace_angles(bases[a], basis))))
                taken = float(np.sum((basis.T @ own) ** 2) / np.sum(own**2))
                found.append(StandIns(a, b, angle, taken))
    return found


def _stacked(assembly: TorqueModel, theta: Array, experiments: Sequence[Experiment], noise: Array) -> Array:
    parts = []
    for experiment in experiments:
        _, blocks = assembly.residual(experiment, theta)
        rows = np.zeros((*experiment.measured.shape, len(theta)))
        for block in blocks:
            rows[:, block.channel, block.index] += block.values / noise[block.channel]
        parts.append(rows.reshape(-1, len(theta)))
    return np.concatenate(parts)


def _basis(matrix: Array) -> Array:
    """Orthonormal columns of the same span, weak directions left out."""
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-30)
    basis, strength, _ = np.linalg.svd(scaled, full_matrices=False)
    return basis[:, strength > WEAK * strength[0]]
