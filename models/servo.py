"""The key ``servo`` of a model file: torque of a joint from what its servo was asked for, where none was logged.

A position servo gives ``stiffness * (command - q) - damping * qd``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..recordings.signals import FREE


@dataclass(frozen=True)
class Servo:
    """Gains of one joint's servo [N·m/rad, N·m·s/rad; or N/m, N·s/m]; None: identified beside the rest."""

    stiffness: float | None
    damping: float | None


def read_servo(path: Path, raw: Mapping[str, Any], joints: Sequence[str]) -> dict[str, Servo]:
    """The key of a model file; raises InputError where an entry is of no form that there is."""
    table = raw.get("servo", {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: [servo] must be a table of joint = {{ kind = 'position', ... }}")
    found = {}
    for joint, entry in table.items():
        if joint not in joints:
            raise InputError(f"{path}: [servo] {joint!r} is no joint that moves here; there are {', '.join(joints)}")
        if not isinstance(entry, dict) or entry.get("kind") != "position":
            raise InputError(
                f"{path}: [servo] {joint} = {entry!r}; allowed is {{ kind = 'position', stiffness = ..., "
                "damping = ... }"
            )
        extra = sorted(set(entry) - {"kind", "stiffness", "damping"})
        if extra:
            raise InputError(f"{path}: [servo] {joint} has {extra[0]!r}; allowed are kind, stiffness, damping")
        gains = [
            _gain(path, joint, key, entry.get(key, usual)) for key, usual in (("stiffness", FREE), ("damping", 0.0))
        ]
        found[joint] = Servo(*gains)
    return found


def servo_fields(servo: Servo) -> dict[str, object]:
    """The entry of a model file that `read_servo` reads back."""
    gains = {"stiffness": servo.stiffness, "damping": servo.damping}
    return {"kind": "position", **{key: FREE if x is None else float(x) for key, x in gains.items()}}


def _gain(path: Path, joint: str, key: str, value: Any) -> float | None:
    if value == FREE:
        return None
    number = isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
    if not number or value < 0 or (key == "stiffness" and value == 0):
        least = "above 0" if key == "stiffness" else "of 0 or more"
        raise InputError(f"{path}: [servo] {joint} {key} = {value!r}; allowed is a number {least}, or {FREE!r}")
    return float(value)
