"""Places for joint effects: a joint, or an axis along a combination of joints, such as a motor of a coupled wrist.

The sum and the difference of two neighbours, ``joint1+joint2`` and ``joint1-joint2``, are axes without being stated.

With w = along · q, an effect's law reads w, its rates and the load back · load, and gives a torque f along w; by
virtual work the joints feel ``along * f``. ``back`` is how the joints move where w alone moves, along · back = 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, nearest

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JointAxis:
    """An axis by the names of its joints.

    Parameters
    ----------
    name : str
    along : mapping of str to float
        Its coordinate, w = sum along[j] * q[j].
    back : mapping of str to float
        How joints move where this axis moves by one, and no other.
    kind : "revolute" or "prismatic"
        Of all its joints.
    """

    name: str
    along: Mapping[str, float]
    back: Mapping[str, float]
    kind: Literal["revolute", "prismatic"]


@dataclass(frozen=True, eq=False)
class Place:
    """A joint or an axis in the order of a tree's J joints: ``along`` and ``back`` (J,), and its kind."""

    name: str
    along: Array
    back: Array
    kind: Literal["revolute", "prismatic"]

    @cached_property
    def channels(self) -> NDArray[np.int_]:
        """Joints that feel a torque along it."""
        return np.flatnonzero(self.along)

    @cached_property
    def alone(self) -> int | None:
        """The joint, where it is one."""
        return int(self.channels[0]) if len(self.channels) == 1 and self.along.sum() == 1 else None

    def coordinate(self, x: Array) -> Array:
        """Position, rate or acceleration of the axis (n,) of the joints' (n, J)."""
        return x @ self.along if self.alone is None else x[:, self.alone]

    def load(self, x: Array) -> Array:
        """Torque that the axis carries (n,) of the joints' (n, J)."""
        return x @ self.back if self.alone is None else x[:, self.alone]

    def inertia(self, matrix: Array) -> Array:
        """The axis' own entry (n,) of the mass matrix (n, J, J)."""
        if self.alone is not None:
            return matrix[:, self.alone, self.alone]
        return np.einsum("j,njk,k->n", self.back, matrix, self.back)


class _Joint(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def kind(self) -> Literal["revolute", "prismatic"]: ...
    @property
    def parent(self) -> int: ...


class _Tree(Protocol):
    @property
    def joints(self) -> Sequence[_Joint]: ...
    @property
    def axes(self) -> Sequence[JointAxis]: ...


def neighbours(tree: _Tree, first: int = 0) -> tuple[JointAxis, ...]:
    """Sum and difference of every two joints of one kind of which one carries the other, from joint ``first`` on."""
    found = []
    for joint in tree.joints[first:]:
        if not first <= joint.parent < len(tree.joints) or tree.joints[joint.parent].kind != joint.kind:
            continue
        other = tree.joints[joint.parent].name
        for word, sign in (("+", 1.0), ("-", -1.0)):
            along = {other: 1.0, joint.name: sign}
            back = {name: x / 2 for name, x in along.items()}
            found.append(JointAxis(f"{other}{word}{joint.name}", along, back, joint.kind))
    return tuple(found)


def place(tree: _Tree, at: str) -> Place:
    """The joint or the axis of a name; KeyError where there is none. Joints that are held have no part in an axis."""
    names = [joint.name for joint in tree.joints]
    if at in names:
        one = np.eye(len(names))[names.index(at)]
        return Place(at, one, one, tree.joints[names.index(at)].kind)
    axis = next((axis for axis in (*tree.axes, *neighbours(tree)) if axis.name == at), None)
    if axis is None:
        raise KeyError(at)
    along, back = (np.array([x.get(name, 0.0) for name in names]) for x in (axis.along, axis.back))
    return Place(at, along, back, axis.kind)


def read_axes(path: Path, raw: Mapping[str, Any], joints: Sequence[_Joint]) -> tuple[JointAxis, ...]:
    """The key ``axes`` of a model file; raises InputError where an entry is no combination of joints that move."""
    table = raw.get("axes", {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: [axes] must be a table of name = {{ joint = factor, ... }}")
    return tuple(_axis(path, name, entry, joints) for name, entry in table.items())


def _axis(path: Path, name: str, entry: Any, joints: Sequence[_Joint]) -> JointAxis:
    kinds: dict[str, Literal["revolute", "prismatic"]] = {joint.name: joint.kind for joint in joints}
    if name in kinds:
        raise InputError(f"{path}: [axes] {name!r} is a joint's name; give the axis one of its own")
    good = isinstance(entry, dict) and any(entry.values())
    if not good or any(
        isinstance(x, bool) or not isinstance(x, int | float) or not np.isfinite(x) for x in entry.values()
    ):
        raise InputError(f"{path}: [axes] {name} = {entry!r}; allowed is {{ joint = factor, ... }}, not all zero")
    for joint in entry:
        if joint not in kinds:
            raise InputError(
                f"{path}: [axes] {name} has {joint!r}, which is no joint that moves here; did you mean "
                f"{nearest(joint, kinds)!r}?"
            )
    if len({kinds[joint] for joint in entry}) > 1:
        raise InputError(f"{path}: [axes] {name} adds angles and lengths; combine joints of one kind")
    along = {joint: float(x) for joint, x in entry.items() if x}
    size = sum(x**2 for x in along.values())
    return JointAxis(name, along, {joint: x / size for joint, x in along.items()}, kinds[next(iter(along))])
