"""Inertial parameters of every link, which a model file knows to a share that the evidence chooses.

A kilogram more, or a metre or a square metre of it, is a column of the rigid body's regressor (Atkeson, An, Hollerbach
1986), and so is a link that is denser than its drawing as a whole, all ten of its parameters by one factor. Where
masses are free the fit has them itself.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ....models.regressor import OWN
from ...evidence.weighed import Part
from ...fitting.assembly import TorqueModel
from ...fitting.experiment import Experiment
from ..whole_mass import by_mass
from ._block import FitContext, NuisanceBlock

Array = NDArray[np.float64]


def blocks(context: FitContext) -> Iterator[NuisanceBlock]:
    """Every inertial parameter in units of its link's own, then every link as a whole."""
    assembly = context.found.assembly
    if assembly.base is not None:
        return
    one = inertial_part(assembly)
    parts: list[dict[int, Part]] = []
    noise_beside: list[dict[int, Array]] = []
    for e in context.along.instruments:
        parts.append({})
        noise_beside.append({})
        for c in range(len(context.along.scale)):
            at, felt = regressor_columns(e, c)
            noise_beside[-1][c] = felt
            scale = by_mass(assembly, e, c)
            if scale is not None:
                felt = felt + scale[:, None] * (at % OWN == 0)
            links, first = np.unique(at // OWN, return_index=True)
            whole = np.add.reduceat(felt * assembly.phi[at], first, axis=1)
            parts[-1][c] = np.concatenate([at, len(one) + links]), np.hstack([felt * one[at], whole])
    yield NuisanceBlock(len(one) + len(one) // OWN, parts, tolerated=True, noise_beside=noise_beside)


def inertial_part(assembly: TorqueModel) -> Array:
    """The unit of every link's inertial parameters (10 L,): its mass, that times its reach, and times its square.

    The reach is the radius of gyration about the link's frame, √(trace(I) / m).
    """
    phi = assembly.phi.reshape(-1, 10)
    mass = np.abs(phi[:, 0])
    reach = np.sqrt(np.maximum(np.abs(phi[:, 4] + phi[:, 7] + phi[:, 9]) / np.maximum(mass, 1e-9), 1e-6))
    return np.stack([mass, *[mass * reach] * 3, *[mass * reach**2] * 6], axis=1).ravel()


def regressor_columns(e: Experiment, channel: int) -> Part:
    """Inertial parameters that a channel feels (k,), and its torque by them in the analysis band (n_band, k)."""
    at, columns = e.regressor.of(channel)
    return at, e.to_band(columns, channel)
