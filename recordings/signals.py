"""The names that a recording's columns can have, and their SI default units.

``time``; of a joint ``q qd qdd q_link tau command temp``; ``tension.<sling>``; of a body ``pos quat vel omega``; of a
wrench sensor ``force torque``; ``angle.ring``; ``closed.latches``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

JointKind = Literal["revolute", "prismatic"]

_JOINT = {
    "q": {"revolute": "rad", "prismatic": "m"},
    "q_link": {"revolute": "rad", "prismatic": "m"},
    "qd": {"revolute": "rad/s", "prismatic": "m/s"},
    "qdd": {"revolute": "rad/s^2", "prismatic": "m/s^2"},
    "tau": {"revolute": "N*m", "prismatic": "N"},
    "command": {"revolute": "rad", "prismatic": "m"},
}
FREE = "free"
"""Gain of a torque whose constant is identified beside the rest; until then one unit of the column counts as one."""

QUATERNION = "wxyz"
"""Order of a quaternion's parts, in names of signals and in arrays (..., 4)."""
POSE = (
    ("pos", "xyz", "m", "position"),
    ("quat", QUATERNION, "1", "attitude (quaternion)"),
    ("vel", "xyz", "m/s", "velocity"),
    ("omega", "xyz", "rad/s", "angular velocity"),
)
"""What a body's pose and twist in the world frame are made of: kind, axes, unit, meaning."""

_SCALAR = {"tension": "N", "temp": "degC"}
_VECTOR = {kind: unit for kind, _, unit, _ in POSE} | {"quat": "dimensionless", "force": "N", "torque": "N*m"}
_SINGLE = {"time": "s", "angle.ring": "rad", "closed.latches": "dimensionless"}

#: How signal names look, for messages.
FORMS = (
    "time, q|qd|qdd|q_link|tau|command|temp.<joint>, tension.<sling>, pos|vel|omega.<body>.x|y|z, quat.<body>.w|x|y|z, "
    "force|torque.<sensor>.x|y|z, angle.ring, closed.latches"
)


def pose_names(body: str) -> list[str]:
    """The thirteen signals of a body's pose and twist, in the order of `POSE`."""
    return [f"{kind}.{body}.{axis}" for kind, axes, _, _ in POSE for axis in axes]


def pose_texts(body: str, text: str) -> list[tuple[str, str, str]]:
    """Name, unit and meaning of each of them; ``text`` names the body."""
    return [
        (f"{kind}.{body}.{axis}", unit, f"{meaning} of {text} in the world frame, {axis}")
        for kind, axes, unit, meaning in POSE
        for axis in axes
    ]


@dataclass(frozen=True)
class Signal:
    """The source of a model's signal in a recording with other column names.

    Parameters
    ----------
    column : str or int
        The recording's column: a header, ``"group/name"`` or ``"name[0]"`` in MATLAB and HDF5 files, and where a table
        has lists in its cells; ``"/topic/field.path"`` in ROS 2 bags; or its number, from 1.
    unit : str, optional
        The column's unit; the header's own unit, or the signal's default, where it is left out.
        With a gain it is what the gain counts per: a header in another unit of its dimension is converted first.
    gain : float or str, optional
        Signal's default unit (N·m or N for ``tau``) per unit of the column, or the name of a number in the recording;
        of a torque also `FREE`: identified.
    columns : mapping of str to float
        Instead of ``column``: columns and their weights, summed before unit and gain.
    offset : float
        Added to the column, or the mix, before unit and gain.
    rate : float, optional
        Instead of ``column``, for time: samples a second [Hz] of a recording that has no clock.
    nothing : bool
        Of a torque: nothing drives the joint, it is zero.
    file : str, optional
        Another file, from the recording's folder, that the column stands in; it has a row for each of the recording's.
    """

    column: str | int
    unit: str | None = None
    gain: float | str | None = None
    columns: Mapping[str, float] = field(default_factory=dict)
    offset: float = 0.0
    rate: float | None = None
    nothing: bool = False
    file: str | None = None

    @property
    def parts(self) -> Mapping[str | int, float]:
        """Columns that it is made of, and their weights."""
        if self.nothing or self.rate is not None:
            return {}
        made: dict[str | int, float] = {}
        return {**made, **self.columns} if self.columns else {self.column: 1.0}


def is_signal(name: str) -> bool:
    """True when ``name`` is one a recording's column can have."""
    family, _, place = name.partition(".")
    if name in _SINGLE:
        return True
    if family in _VECTOR:
        body, _, axis = place.rpartition(".")
        return bool(body) and axis in (("w", "x", "y", "z") if family == "quat" else ("x", "y", "z"))
    return bool(place) and (family in _JOINT or family in _SCALAR)


def joint_of(name: str) -> str | None:
    """The joint of a signal whose unit depends on the joint's kind (``q qd qdd q_link tau command``), else None."""
    family, _, joint = name.partition(".")
    return joint if family in _JOINT else None


def default_unit(name: str, kind: JointKind = "revolute") -> str:
    """SI default unit of a signal, as pint reads it; ``kind`` matters for joint signals only."""
    family = name.partition(".")[0]
    if family in _JOINT:
        return _JOINT[family][kind]
    return (_SINGLE | _SCALAR | _VECTOR)[name if name in _SINGLE else family]


def joint_signals(names: Iterable[str]) -> list[str]:
    """Those of ``names`` that are a joint's motion or torque."""
    return [name for name in names if joint_of(name) is not None]
