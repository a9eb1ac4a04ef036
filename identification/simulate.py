"""``snarelab simulate``: what every torque channel would read along a recorded motion, as a recording."""

import warnings
from pathlib import Path

import numpy as np
import xarray as xr

from ..errors import InputError
from ..models.model import Model
from ..models.rigid_body import RigidBody
from .empirical import beyond
from .fitting.assembly import TorqueModel
from .fitting.base_parameters import INERTIAL
from .fitting.experiment import load_experiments, scales
from .simulate_floating import simulate_floating
from .simulated import simulated_kind


def simulate(model: Model, motion: str | Path | None) -> xr.Dataset:
    """Torque of a model along the motion of a recording (inverse dynamics with every effect).

    Parameters
    ----------
    model : Model
        Its file must hold values of all parameters that its effects have; `identify` or `diagnose` saves such a file.
    motion : path or None
        Recording with the position of every joint; a recorded torque is not used. A capture needs none
        (`identification.snare.simulate`).

    Returns
    -------
    xarray.Dataset
        ``q qd qdd tau`` of every joint, over the samples whose derivatives are known; on a floating base that and the
        base's motion (`simulate_floating`).

    Raises
    ------
    InputError
        A parameter without a value, or whatever is wrong with the recording.
    """
    tree = model.tree
    simulated = simulated_kind(tree)
    if simulated is not None:
        return simulated.simulate(model, motion)
    if motion is None:
        raise InputError(f"{model.path}: system = {model.system!r} follows a motion; give --motion RECORDING")
    read = [] if tree.carriers else load_experiments(model, [motion], RigidBody(tree), torque=False)
    inertial = [f"inertia.{link.name}.{name}" for link in model.tree.links for name in INERTIAL]
    model.demand_values(*(inertial if model.inertia == "free" else ()))
    if tree.carriers:
        return simulate_floating(model, motion)
    (experiment,) = read
    assembly = TorqueModel(model.tree, model.effects, None, scales([experiment]), model.values)
    recorded = experiment.motion
    # As they are: bounds refer to the recordings that the values came from, not to this motion.
    tau = assembly.torque(experiment, np.array([model.values[s.key] for s in assembly.slots]))
    for line in beyond(assembly, experiment, np.array([model.values[s.key] for s in assembly.slots])):
        warnings.warn(line, stacklevel=2)
    variables = {}
    for name, x in (("q", recorded.q), ("qd", recorded.qd), ("qdd", recorded.qdd), ("tau", tau)):
        for c, joint in enumerate(model.joints):
            variables[f"{name}.{joint}"] = ("time", np.ascontiguousarray(x[:, c]))
    return xr.Dataset(
        variables, coords={"time": recorded.time}, attrs={"path": str(motion), "notes": list(recorded.notes)}
    )
