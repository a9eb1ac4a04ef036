"""The set-up of a capture test as a model file gives it: ``[capture]``, and what each effect means for it.

Keys of the table are the fields of `SnareParameters` and `Target`, in their units; what is left out is the built-in
snare and the paper's ground test. Numbers that belong to an effect are refused there: an effect that the model does not
list is absent (no friction, no contact damping, no pretension, no umbilical, no play). Two cannot be absent: a contact
without stiffness and a rope without damping do not exist, so that the set-up's numbers hold where the model does not
list `contact_stiffness` and `cable_damping`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, unknown_key
from ..tree import Tree
from .parameters import SnareParameters, wall_length
from .target import Target

SUPPORTS = ("spring", "pendulum", "free")


@dataclass(frozen=True)
class SetupField:
    """What an effect sets: its place in a model file, its parameter, and the field of set-up or target."""

    at: str
    parameter: str
    field: str
    of_target: bool
    absent: float | None
    """The field's value in a model without the effect; None: the set-up's own."""
    grid: tuple[float, ...] = ()
    """Where a number of the set-up is tried, in shares of what it is said to be."""
    inverse: bool = False
    """Whether it does the less, the larger its parameter is."""


APPLIED = {
    "contact_friction": SetupField("pin", "coefficient", "friction", False, 0.0),
    "contact_damping": SetupField("pin", "coefficient", "contact_damping", False, 0.0),
    "contact_stiffness": SetupField("pin", "stiffness", "hertz_stiffness", False, None, inverse=True),
    "cable_damping": SetupField("cables", "time", "bending_damping", False, None),
    "cable_pretension": SetupField("cables", "tension", "cable_pretension", False, 0.0),
    "umbilical_stiffness": SetupField("target", "stiffness", "umbilical", True, 0.0),
    "hang_point_clearance": SetupField("target", "clearance", "clearance", True, 0.0),
}
"""The vocabulary's effects that a capture can have."""

NUMBERS = {
    "ring_radius": SetupField("capture", "value", "ring_radius", False, None, (0.98, 1.024)),
    "pin_radius": SetupField("capture", "value", "pin_radius", False, None, (0.8, 1.25)),
    "mass": SetupField("capture", "value", "mass", True, None, (0.6, 1.6)),
}
"""Numbers of the set-up that nobody has stated for the built-in one: a diagnosis may find that they are others, where
the model file does not give them. Cables then lie against the wall of a ring of that radius, as they do by default."""

TOLERANCES = {"cable_damping.cables.time": 1e-3}
"""How far numbers of the set-up may be from what they are said to be: one standard deviation, in their units; chosen. A
rope's own damping is nobody's drawing: what is said of it may be off by as much as that is."""

_OF_EFFECTS = {a.field: name for name, a in APPLIED.items() if a.absent is not None}
_NUMBERS = tuple(f.name for f in fields(SnareParameters) if f.name not in _OF_EFFECTS)
_TARGET = {"mass": 0, "line_length": 0, "stiffness": 0, "damping": 0} | dict.fromkeys(
    ("position", "velocity", "angular_velocity", "centre_of_mass", "hang_point", "inertia"), 3
)
_KEYS = ("target", "orientation", *_TARGET, *_NUMBERS)


@dataclass(frozen=True)
class CaptureSetup:
    """A snare and its target without any effect, and the keys that the model file gave."""

    parameters: SnareParameters
    target: Target
    given: Mapping[str, Any] = field(default_factory=dict)

    def with_values(self, values: Mapping[str, float]) -> "CaptureSetup":
        """With effects' parameters by ``effect.place.parameter``, and numbers of the set-up; others are no matter."""
        snare, target = {}, {}
        for name, a in (APPLIED | NUMBERS).items():
            value = values.get(f"{name}.{a.at}.{a.parameter}")
            if value is not None:
                (target if a.of_target else snare)[a.field] = float(value)
        if "ring_radius" in snare and "cable_length" not in self.given:
            snare["cable_length"] = wall_length(snare["ring_radius"], self.parameters.ring_distance)
        return replace(self, parameters=self.parameters.with_values(**snare), target=replace(self.target, **target))

    def corrected(self, values: Mapping[str, float]) -> "CaptureSetup":
        """With numbers of the set-up that a diagnosis found, as if the model file had given them."""
        own = {name: values[key] for name in NUMBERS if (key := f"{name}.capture.value") in values}
        numbers = self.with_values({f"{name}.capture.value": value for name, value in own.items()})
        if "ring_radius" in own:
            own["cable_length"] = numbers.parameters.cable_length
        return replace(numbers, given={**self.given, **own}) if own else self

    def usual(self, name: str) -> float:
        """Value of an effect's parameter that stands for its absence."""
        a = (APPLIED | NUMBERS)[name]
        return getattr(self.target if a.of_target else self.parameters, a.field)


@dataclass(frozen=True, eq=False)
class SnareTree(Tree):
    """A capture has no joints: what stands for them is the set-up."""

    setup: CaptureSetup

    def __post_init__(self) -> None:
        """Nothing that the recursions of joints could refuse."""

    @property
    def simulated_as(self) -> str:
        """A capture."""
        return "snare"


def snare_places(name: str, tree: SnareTree) -> tuple[str, ...]:
    """Where an effect acts in a capture; nowhere if it cannot."""
    a = APPLIED.get(name)
    if a is None or (name == "hang_point_clearance" and not tree.setup.target.hangs):
        return ()
    return (a.at,)


def read_setup(path: Path, name: str, table: Any, gravity: list[float]) -> SnareTree:
    """A model file's ``[capture]``; None for the built-in one.

    Raises
    ------
    InputError
        For an unknown key, a value of the wrong kind, or whatever snare and target refuse.
    """
    given = {} if table is None else table
    if not isinstance(given, dict):
        raise InputError(f"{path}: capture = {given!r}; allowed is a table [capture]")
    for key in given:
        if key in _OF_EFFECTS:
            raise InputError(
                f"{path}: [capture] {key} belongs to the effect {_OF_EFFECTS[key]}; list that in effects, and its "
                "value under [parameters]"
            )
        if key not in _KEYS:
            raise unknown_key(path, key, _KEYS, "capture")
    support = given.get("target", "spring")
    if support not in SUPPORTS:
        raise InputError(f"{path}: [capture] target = {support!r}; allowed are {', '.join(SUPPORTS)}")
    values = {key: _value(path, key, x) for key, x in given.items() if key != "target"}
    absent = {a.field: a.absent for a in APPLIED.values() if a.absent is not None and not a.of_target}
    body: dict[str, Any] = {key: values[key] for key in (*_TARGET, "orientation") if key in values}
    if not np.linalg.norm(gravity) > 0 and support != "free":
        raise InputError(f"{path}: gravity is none, and a line holds the target; give target = 'free', or gravity")
    try:
        snare = SnareParameters().with_values(**absent, **{key: values[key] for key in _NUMBERS if key in values})
        target = Target(support, gravity=gravity, **body)
    except InputError as error:
        raise InputError(f"{path}: [capture] {error}") from None
    return SnareTree(name, (), (), np.array(gravity, float), CaptureSetup(snare, target, dict(given)))


def _value(path: Path, key: str, value: Any) -> Any:
    """A number, a list of them, or for the inertia three lists of three or its three principal moments."""
    count = 4 if key == "orientation" else _TARGET.get(key, 0)
    try:
        array = np.asarray(value)
        right = array.dtype.kind in "iuf" and bool(np.all(np.isfinite(array)))
    except ValueError:
        array, right = np.zeros(0), False
    shapes = [(count,) if count else ()] + ([(3, 3)] if key == "inertia" else [])
    if not right or array.shape not in shapes:
        wanted = f"a list of {count} numbers" if count else "a number"
        raise InputError(f"{path}: [capture] {key} = {value!r}; allowed is {wanted}")
    if key == "inertia" and array.shape == (3,):
        array = np.diag(array)
    return array.tolist() if count else float(array)
