"""Recordings read once for all that looks at them, and the joints that none of them has, held."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from ...errors import InputError
from ...models.hold import hold
from ...models.model import Model, places
from ...models.tree import Tree
from ...recordings import JointKind, read_recording
from ...recordings.signals import joint_of


def read_all(model: Model, paths: Sequence[str | Path]) -> list[xr.Dataset]:
    """Every recording, with the model's [signals]; raises InputError for whatever is wrong with one."""
    kinds: dict[str, JointKind] = {j.name: j.kind for j in model.tree.joints}
    return [model.cuts(read_recording(path, model.signals, kinds)) for path in paths]


def with_recorded_joints(model: Model, datasets: Sequence[xr.Dataset]) -> Model:
    """The model with joints that no recording has held at zero, and a note that names them.

    Only for an arm whose file does not say itself which joints move. Where a recording has a joint that the URDF has
    not, a name may be misspelt: nothing is held then, and the missing signal is asked for as ever.

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
        p for p in model.effects if p.at in places(p.effect, tree) or (joint_of(p.at) or missing[0]) not in gone
    )
    locked = {**model.holding.locked, **dict.fromkeys(missing, 0.0)}
    return replace(model, tree=tree, effects=kept, holding=replace(model.holding, locked=locked))
