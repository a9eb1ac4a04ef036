"""Recordings, read once for checks and fits; joints that no recording has are held."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from ...errors import InputError
from ...models.hold import hold
from ...models.model import Model, all_places
from ...models.tree import Tree
from ...recordings import JointKind, read_recording
from ...recordings.signals import Signal, default_unit, joint_of


def read_all(model: Model, paths: Sequence[str | Path]) -> list[xr.Dataset]:
    """Every recording, with the model's joints; raises InputError for one that cannot be used."""
    return [model.cuts(_with_servos(_of_joints(model, path, model.signals), model)) for path in paths]


def read_motion(model: Model, path: str | Path) -> xr.Dataset:
    """A recording of which only the motion is used: it needs no torques."""
    return _of_joints(model, path, motion_signals(model))


def motion_signals(model: Model) -> dict[str, Signal]:
    """A model's [signals] without the torques, which a motion that is only followed does not need."""
    return {name: signal for name, signal in model.signals.items() if not name.startswith("tau.")}


def _of_joints(model: Model, path: str | Path, signals: Mapping[str, Signal]) -> xr.Dataset:
    """A recording with what its motors say turned into what the joints do."""
    kinds: dict[str, JointKind] = {j.name: j.kind for j in model.tree.joints}
    if model.transmission is None:
        return read_recording(path, signals, kinds)
    own = kinds.get(model.transmission.joints[0], "revolute")
    motors: dict[str, JointKind] = {motor: own for motor in model.transmission.motors}
    return model.transmission(read_recording(path, signals, {**kinds, **motors}))


def _with_servos(dataset: xr.Dataset, model: Model) -> xr.Dataset:
    """The recording with stiffness * (command - q) as torque of each joint that has a servo; per unit while free."""
    made = {}
    kinds: dict[str, JointKind] = {j.name: j.kind for j in model.tree.joints}
    for joint, servo in model.servo.items():
        for name in (f"command.{joint}", f"q.{joint}"):
            if name not in dataset:
                raise InputError(
                    f"{dataset.attrs['path']}: no signal {name!r}, which [servo] works out the torque from; add the "
                    "column, or map it under [signals] in the model file"
                )
        attrs = {"unit": default_unit(f"tau.{joint}", kinds[joint]), "column": f"command.{joint} - q.{joint}"}
        stiffness = 1.0 if servo.stiffness is None else servo.stiffness
        made[f"tau.{joint}"] = (stiffness * (dataset[f"command.{joint}"] - dataset[f"q.{joint}"])).assign_attrs(attrs)
    return dataset.assign(made)


def with_recorded_joints(model: Model, datasets: Sequence[xr.Dataset]) -> Model:
    """The model with joints that no recording has held at zero, and a note that names them.

    Only for an arm whose file does not say itself which joints move. Where a recording has a joint that the URDF has
    not, a name may be misspelt: then nothing is held, and the missing signal is an error.

    Raises
    ------
    InputError
        A recording has torque of a joint that moves no mass.
    """
    names = {str(name) for dataset in datasets for name in dataset.data_vars}
    for joint in model.tree.weightless:
        for dataset in datasets:
            if f"tau.{joint}" in dataset and np.nanmax(np.abs(dataset[f"tau.{joint}"].to_numpy())) > 0:
                raise InputError(
                    f"{model.urdf}: joint '{joint}' moves no mass, and {dataset.attrs['path']} has a torque of it; "
                    f"give a link beyond it an <inertial>, or leave it out: locked = {{ {joint} = 0.0 }}"
                )
    recorded = {joint for name in names if (joint := joint_of(name)) is not None}
    known = {*model.joints, *model.holding.locked, *model.tree.weightless}
    missing = [joint for joint in model.joints if joint not in recorded]
    own_choice = type(model.tree) is not Tree or model.holding.joints is not None
    if own_choice or not missing or recorded - known or len(missing) == len(model.joints):
        return model
    note = f"{', '.join(missing)}: in no recording, held where the URDF's zero is"
    tree = hold(model.tree, dict.fromkeys(missing, 0.0))
    tree = replace(tree, notes=(*tree.notes, note))
    gone = set(missing)
    kept = tuple(
        p for p in model.effects if p.at in all_places(p.effect, tree) or (joint_of(p.at) or missing[0]) not in gone
    )
    locked = {**model.holding.locked, **dict.fromkeys(missing, 0.0)}
    return replace(model, tree=tree, effects=kept, holding=replace(model.holding, locked=locked))
