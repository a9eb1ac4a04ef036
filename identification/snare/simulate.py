"""A capture simulated by a model with values, as a recording."""

from pathlib import Path

import numpy as np
import xarray as xr

from ...errors import InputError
from ...models.model import Model
from ...models.snare.setup import SnareTree
from ...recordings.signals import QUATERNION
from .recording import ON_TARGET, load_captures

SAMPLE = 0.01
"""[s] Between the rows of a simulated recording."""
DURATION = 10.0
"""[s] Of a simulated capture without a motion: the paper's."""


def simulate_capture(model: Model, motion: str | Path | None = None) -> xr.Dataset:
    """A capture by a model with values, as a recording.

    Parameters
    ----------
    model : Model
        With a value for every effect's parameter.
    motion : path or None
        Recording that gives the ring's angle and the target's pose at the start; None: those of the model, for 10 s.

    Returns
    -------
    xarray.Dataset
        ``angle.ring``, ``pos quat vel omega`` of the target, ``force`` on target and on the end effector's root
        (``ring``), averaged since the row before, ``torque.ring``; every 10 ms.

    Raises
    ------
    InputError
        A parameter without a value, or whatever is wrong with the recording.
    """
    from ...models.snare.model import SnareModel, SnareStepError

    model.demand_values()
    setup, drive, duration, zero, body, sensor = model.tree_as(SnareTree).setup, None, DURATION, 0.0, "target", "ring"
    if motion is not None:
        (given,) = load_captures(model, [motion])
        setup, drive, duration, zero, body = given.setup, given.drive, float(given.times[-1]), given.zero, given.body
        sensor = given.sensors.get("effector", sensor)
    setup = setup.with_values(
        {key: model.values[key] for p in model.effects for key in (f"{p.key}.{x.name}" for x in p.effect.parameters)}
    )
    try:
        history = SnareModel(setup.parameters, setup.target, drive=drive).run(duration, every=SAMPLE)
    except SnareStepError as fault:
        raise InputError(f"{model.path}: the capture cannot be simulated: {fault}") from None
    vectors = {
        f"pos.{body}": history.target_position,
        f"vel.{body}": history.target_velocity,
        f"omega.{body}": history.target_angular_velocity,
        f"force.{sensor}": history.mean_force,
        f"torque.{sensor}": history.torque,
        f"force.{ON_TARGET[0]}": history.mean_pin_force,
    }
    columns = {f"{name}.{a}": x[:, i] for name, x in vectors.items() for i, a in enumerate("xyz")}
    columns |= {f"quat.{body}.{a}": history.target_quaternion[:, i] for i, a in enumerate(QUATERNION)}
    columns["angle.ring"] = history.ring_angle
    variables = {name: ("time", np.ascontiguousarray(x)) for name, x in columns.items()}
    attributes = {"path": str(motion or model.path), "notes": []}
    return xr.Dataset(variables, coords={"time": zero + SAMPLE * np.arange(len(history.times))}, attrs=attributes)
