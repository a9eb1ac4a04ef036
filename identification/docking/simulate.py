"""A docking test simulated by a model with values, as a recording."""

from pathlib import Path

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...models.docking.bench import SEEN
from ...models.docking.bench_setup import DockingTree
from ...models.model import Model
from ...recordings.signals import QUATERNION
from .recording import EVERY, KNOTS, load_records
from .runs import SHIFTS, DockingRuns
from .source import start


def simulate_docking(model: Model, motion: str | Path | None = None) -> xr.Dataset:
    """A docking test by a model with values, as a recording.

    Parameters
    ----------
    model : Model
        With a value for every effect's parameter.
    motion : path
        Recording that gives the carriage's travel, the latches' closing and the pose at the start.

    Returns
    -------
    xarray.Dataset
        Means over 50 ms, at the middle of each: ``pos quat`` of ``effector``, ``force torque`` of ``target``,
        ``tau.carriage``, ``tension`` of the latches; and the travel ``q.carriage`` and ``closed.latches`` as given.

    Raises
    ------
    InputError
        A parameter without a value, no motion, or whatever is wrong with it.
    """
    setup = model.tree_as(DockingTree).setup
    model.demand_values()
    if motion is None:
        raise InputError(f"{model.path}: system = 'docking' follows a test; give --motion RECORDING")
    (record,) = load_records(model, [motion])
    m = record.motion
    seen = DockingRuns(setup, [record]).seen(0, start(model).all_values, np.zeros(len(SHIFTS)))
    if seen is None:
        raise InputError(f"{model.path}: the docking cannot be simulated from where {motion} starts; check [docking]")
    columns = {name: seen[:, c] for c, name in enumerate(SEEN) if not name.startswith("turn.")}
    turned = seen[:, [SEEN.index(f"turn.effector.{a}") for a in "xyz"]]
    quaternion = (Rotation.from_rotvec(turned) * Rotation.from_quat(m.quaternion, scalar_first=True)).as_quat(
        scalar_first=True
    )
    columns |= {f"quat.effector.{a}": quaternion[:, i] for i, a in enumerate(QUATERNION)}
    middle = 0.5 * (m.times[1:] + m.times[:-1])
    columns["q.carriage"] = np.interp(middle, m.times, m.travel)
    begun, closed = m.latch
    columns["closed.latches"] = np.clip((middle - begun) / (closed - begun), 0.0, 1.0)
    variables = {name: ("time", np.ascontiguousarray(x)) for name, x in columns.items()}
    attributes = {"path": str(motion), "notes": [f"means over {EVERY / KNOTS:g} s"]}
    return xr.Dataset(variables, coords={"time": record.zero + middle}, attrs=attributes)
