"""The key ``transmission`` of a model file: motors that move several joints.

    q = T q_motor,    tau = T^-T tau_motor    (virtual work: tau · q' = tau_motor · q_motor')

A motor is an axis: its coordinate is its row of T^-1, and where it alone moves, joints move by its column of T.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..errors import InputError
from ..recordings.signals import JointKind
from .axes import JointAxis
from .tree import Joint

Array = NDArray[np.float64]

SINGULAR = 1e-9
"""Ratio of smallest to largest singular value below which motors cannot move their joints apart."""


@dataclass(frozen=True, eq=False)
class Transmission:
    """Motors, joints, and the matrix T (joints, motors) between them."""

    motors: tuple[str, ...]
    joints: tuple[str, ...]
    matrix: Array

    def axes(self, joints: Sequence[Joint]) -> tuple[JointAxis, ...]:
        """Each motor as a place for effects."""
        kind: JointKind = next(joint.kind for joint in joints if joint.name == self.joints[0])

        def by_joint(row: Array) -> dict[str, float]:
            return {joint: float(x) for joint, x in zip(self.joints, row, strict=True) if x}

        ways = zip(self.motors, np.linalg.inv(self.matrix), self.matrix.T, strict=True)
        return tuple(JointAxis(motor, by_joint(along), by_joint(back), kind) for motor, along, back in ways)

    def __call__(self, dataset: xr.Dataset) -> xr.Dataset:
        """A recording of motors as one of joints; what is recorded of the joints themselves stays.

        Raises
        ------
        InputError
            Some of the motors' positions or torques are missing.
        """
        made: dict[str, xr.DataArray] = {}
        for family, by in (("q", self.matrix), ("tau", np.linalg.inv(self.matrix).T)):
            if all(f"{family}.{j}" in dataset for j in self.joints):
                continue
            given = [m for m in self.motors if f"{family}.{m}" in dataset]
            if not given:
                continue
            missing = [m for m in self.motors if m not in given]
            if missing:
                raise InputError(
                    f"{dataset.attrs.get('path', 'recording')}: has {family}.{given[0]} and no {family}.{missing[0]}; "
                    "[transmission] needs all of its motors: add the column, or map it under [signals]"
                )
            for joint, row in zip(self.joints, by, strict=True):
                parts = [float(x) * dataset[f"{family}.{m}"] for x, m in zip(row, self.motors, strict=True) if x]
                attrs = {**dataset[f"{family}.{given[0]}"].attrs, "column": f"{family} of {', '.join(self.motors)}"}
                made[f"{family}.{joint}"] = sum(parts[1:], parts[0]).assign_attrs(attrs)
        own = [name for name in dataset.data_vars if str(name).partition(".")[2] in self.motors]
        return dataset.drop_vars(own).assign(made)


def read_transmission(path: Path, raw: Mapping[str, Any], joints: Sequence[Joint]) -> Transmission | None:
    """The key of a model file; raises InputError where it is of no form that there is."""
    if "transmission" not in raw:
        return None
    table = raw["transmission"]
    form = "[transmission] has motors = [names], joints = [names], and matrix, a row a joint"
    if not isinstance(table, dict) or set(table) != {"motors", "joints", "matrix"}:
        raise InputError(f"{path}: transmission = {table!r}; {form}")
    motors, moved, kinds = table["motors"], table["joints"], {joint.name: joint.kind for joint in joints}
    for key, names in (("motors", motors), ("joints", moved)):
        good = isinstance(names, list) and names and all(isinstance(n, str) and n for n in names)
        if not good or len(set(names)) != len(names):
            raise InputError(f"{path}: [transmission] {key} = {names!r}; allowed is a list of names, each once")
    for joint in moved:
        if joint not in kinds:
            raise InputError(
                f"{path}: [transmission] {joint!r} is no joint that moves here; there are {', '.join(kinds)}"
            )
    for motor in motors:
        if motor in kinds:
            raise InputError(f"{path}: [transmission] {motor!r} is a joint's name; give the motor one of its own")
    if len({kinds[joint] for joint in moved}) > 1:
        raise InputError(f"{path}: [transmission] mixes angles and lengths; couple joints of one kind")
    try:
        matrix = np.array(table["matrix"], float)
    except (ValueError, TypeError):
        matrix = np.zeros(0)
    n = len(moved)
    if matrix.shape != (n, len(motors)) or n != len(motors) or not np.isfinite(matrix).all():
        raise InputError(
            f"{path}: [transmission] matrix = {table['matrix']!r}; allowed are {n} rows, a joint each, of "
            f"{n} numbers, a motor each"
        )
    size = np.linalg.svd(matrix, compute_uv=False)
    if size[-1] < SINGULAR * size[0]:
        raise InputError(
            f"{path}: [transmission] matrix is singular: the motors cannot move the joints apart; correct it"
        )
    return Transmission(tuple(motors), tuple(moved), matrix)


def transmission_fields(given: Transmission) -> dict[str, object]:
    """The table that `read_transmission` reads back."""
    return {
        "motors": list(given.motors),
        "joints": list(given.joints),
        "matrix": [[float(x) for x in r] for r in given.matrix],
    }
