"""The set-up of a docking test as a model file gives it: ``[docking]``, and where effects act in it.

An end effector with balls, carriage and latches hangs in a soft mount (the arm, or a suspension) before a target that
stands on a force sensor. The carriage draws it in by the target's knob, preloads it, latches it, and pushes it off
again. Keys of the table are the fields of `DockingParameters` that the test needs and those of `Bench`. Numbers that
belong to an effect are refused there: an effect that the model does not list is absent.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, unknown_key
from ..effects import effects
from ..tree import Tree
from .groove import BALLS
from .parameters import DockingParameters, _number

OF_EFFECTS = {"friction": "docking_friction", "coulomb": "carriage_friction", "viscous": "carriage_friction"}
"""Fields of `DockingParameters` that stand for an effect."""
AT = ("carriage", "grooves", "groove", "latches")
"""Kinds of place in a docking."""
GROOVES = tuple(f"groove{i + 1}" for i in range(BALLS))
TOLERANCES = {
    "front": 5e-5,
    "slack": 2e-4,
    "seat": 2e-5,
    "mass": 1.0,
    "mount_stiffness": 50.0,
    "mount_damping": 30.0,
    "turning_stiffness": 10.0,
    "turning_damping": 5.0,
    "cable_stiffness": 6e3,
    "stiffness": 5e5,
    "bumper_stiffness": 5e4,
    "damping": 100.0,
    "bumper_damping": 150.0,
    "latch_stiffness": 5e6,
    "latch_preload": 50.0,
}
"""How far numbers of the set-up may be from what they are said to be: one standard deviation, in their units; chosen as
a workshop measures them, and for stiffness and damping of contacts as laws of contact differ."""
FACTORS = {"breakaway": 1.0}
"""Tolerances of numbers that are known to a factor: one standard deviation of the logarithm; chosen, three times either
way. How far a contact gives way before it slides is nobody's drawing."""
MACHINED = {f"groove_misalignment.{at}.offset": 2e-5 for at in GROOVES}
"""What a workshop's tolerance leaves of an effect: one standard deviation, in the parameter's unit; chosen. More than
that is a misalignment."""
REGISTRATION = {f"register.{a}": 1e-5 for a in "xyz"} | {f"register.turn.{a}": 3e-5 for a in "xyz"}
"""How far the measured pose may be from the true one in the target's frame: one standard deviation [m, rad]; chosen, as
a laser tracker on reference nests has it."""
_UNUSED = [
    "restitution_speed",
    "switch_travel",
    "lead",
    "efficiency",
    "torque_limit",
    "stroke",
    "drive_stiffness",
    "drive_damping",
    "brake_stiffness",
    "brake_damping",
    "stop_stiffness",
    "stop_damping",
    "latch_time",
]


@dataclass(frozen=True)
class Bench:
    """What a docking test has beside the mechanism. The end effector's frame has its origin at its centre of mass.

    Raises
    ------
    InputError
        For a value that is not finite or not in its range.
    """

    mass: float = _number(120.0, "kg", "end effector, its carriage and what the mount moves with it")
    inertia_x: float = _number(6.0, "kg*m**2", "of the same, about the axis")
    inertia_y: float = _number(10.0, "kg*m**2", "of the same, across")
    inertia_z: float = _number(10.0, "kg*m**2", "of the same, across")
    mount_stiffness: float = _number(3000.0, "N/m", "of the mount, every way; gives way as an arm's servo does")
    mount_damping: float = _number(900.0, "N*s/m", "of the mount, every way")
    turning_stiffness: float = _number(600.0, "N*m/rad", "of the mount against turning, about every axis")
    turning_damping: float = _number(120.0, "N*m*s/rad", "of the mount against turning, about every axis")
    knob: float = _number(0.26, "m", "from the target's face to the pin's knob: the snare's pin")
    ring: float = _number(0.15, "m", "from the frame's origin back to the rings' middle, carriage at 0")
    slack: float = _number(0.015, "m", "free length of the closed cables, from the rings' middle to the knob")
    cable_stiffness: float = _number(4e5, "N/m", "of the three cables that draw the knob, along the pin")
    cable_damping: float = _number(2000.0, "N*s/m", "of the same", ">= 0")

    def __post_init__(self) -> None:
        """Refuse what cannot be built."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not (isfinite(value) and (value >= 0 if item.metadata["allowed"] == ">= 0" else value > 0)):
                unit, allowed = item.metadata["unit"], item.metadata["allowed"]
                raise InputError(f"docking: {item.name} is {value:g} {unit}; give {allowed}")


@dataclass(frozen=True)
class BenchSetup:
    """Mechanism and bench without any effect, and the keys that the model file gave."""

    mechanism: DockingParameters
    bench: Bench = field(default_factory=Bench)
    given: Mapping[str, float] = field(default_factory=dict)

    def values(self) -> dict[str, float]:
        """Every number by its name."""
        own = {item.name: float(getattr(self.bench, item.name)) for item in fields(Bench)}
        return self.mechanism.values() | own


@dataclass(frozen=True, eq=False)
class DockingTree(Tree):
    """A docking has no joints: what stands for them is the set-up."""

    setup: BenchSetup

    def __post_init__(self) -> None:
        """Nothing that the recursions of joints could refuse."""

    @property
    def simulated_as(self) -> str:
        """A docking test."""
        return "docking"


def docking_places(at: str) -> tuple[str, ...]:
    """Where an effect of a kind of place acts in a docking; nowhere if it cannot."""
    return () if at not in AT else GROOVES if at == "groove" else (at,)


def docking_effects() -> dict[str, tuple[str, ...]]:
    """Every effect that a docking can have, and its places."""
    return {name: docking_places(e.at) for name, e in effects().items() if e.at in AT}


def read_bench(path: Path, name: str, table: Any) -> DockingTree:
    """A model file's ``[docking]``; None for the built-in bench.

    Raises
    ------
    InputError
        For an unknown key, a value of the wrong kind, or whatever mechanism and bench refuse.
    """
    given = {} if table is None else table
    if not isinstance(given, dict):
        raise InputError(f"{path}: docking = {given!r}; allowed is a table [docking]")
    mechanism = [f.name for f in fields(DockingParameters) if f.name not in (*OF_EFFECTS, *_UNUSED)]
    bench = [f.name for f in fields(Bench)]
    for key, value in given.items():
        if key in OF_EFFECTS:
            raise InputError(
                f"{path}: [docking] {key} belongs to the effect {OF_EFFECTS[key]}; list that in effects, and its value "
                "under [parameters]"
            )
        if key not in (*mechanism, *bench):
            raise unknown_key(path, key, (*mechanism, *bench), "docking")
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise InputError(f"{path}: [docking] {key} = {value!r}; allowed is a number")
    numbers = {key: float(value) for key, value in given.items()}
    absent = dict.fromkeys(OF_EFFECTS, 0.0)
    try:
        own = DockingParameters(**absent, **{k: v for k, v in numbers.items() if k in mechanism})
        setup = BenchSetup(own, Bench(**{k: v for k, v in numbers.items() if k in bench}), numbers)
    except InputError as error:
        raise InputError(f"{path}: [{error}".replace("[docking:", "[docking]")) from None
    return DockingTree(name, (), (), np.zeros(3), setup)
