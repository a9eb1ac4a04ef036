"""A momentum balance has no scale: what masses change of a floating base's channels is told beside the scale.

Nothing holds what floats, so that its balance of momentum, 0 = W(q, qd, qdd) phi, stays true if every inertial
parameter is multiplied by the same number; and its error in newtons vanishes with the masses. A likelihood in newtons
would rather have no masses than whatever else is missing. So the whole mass m of the model is kept: a kilogram more of
link k comes with as much less of all, and changes a channel by

    W_k - W phi / m.

Joints' torque sensors have a scale, and so do their channels.
"""

import numpy as np
from numpy.typing import NDArray

from ...models.regressor import OWN
from ..fitting.assembly import TorqueModel
from ..fitting.experiment import Experiment

Array = NDArray[np.float64]


def by_mass(assembly: TorqueModel, experiment: Experiment, channel: int) -> Array | None:
    """What a kilogram more of any link adds to a floating base's channel for the scale's sake (n_band,) [N/kg or
    N·m/kg]; None of the channels of joints."""
    if channel >= assembly.tree.carriers:
        return None
    at, columns = experiment.regressor.of(channel)
    return -experiment.to_band(columns @ assembly.phi[at], channel) / float(np.sum(assembly.phi[::OWN]))
