"""The keys ``joints``, ``locked`` and ``inertia_fix`` of a model file: what of a robot's file moves here."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .published_inertia import Fix


@dataclass(frozen=True)
class Holding:
    """Joints that move, joints that are held, and inertias that are mended.

    Parameters
    ----------
    joints : tuple of str or None
        The joints that move; None: all that are not ``locked``.
    locked : mapping of str to float
        Where joints are held [rad or m]; zero for those that ``joints`` leaves out.
    fix : "" or "nearest"
        What is done about a moving body that no body can be: refused, or given the nearest inertia.
    """

    joints: tuple[str, ...] | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    fix: Fix = ""


def read_holding(path: Path, raw: Mapping[str, Any], system: str) -> Holding:
    """The three keys of a model file; raises InputError where one is not of its kind, or of no use to the system."""
    given = [key for key in ("joints", "locked", "inertia_fix") if key in raw]
    if given and (system not in ("arm", "zero_g_rig") or "urdf" not in raw):
        raise InputError(f"{path}: key {given[0]!r} belongs to an arm with a URDF of its own; take it out")
    joints, locked, fix = raw.get("joints"), raw.get("locked", {}), raw.get("inertia_fix", "")
    if joints is not None and (
        not isinstance(joints, list) or not joints or not all(isinstance(j, str) for j in joints)
    ):
        raise InputError(f"{path}: joints = {joints!r}; allowed is a list of the names of the joints that move")
    good = isinstance(locked, dict) and all(
        isinstance(x, int | float) and not isinstance(x, bool) and np.isfinite(x) for x in locked.values()
    )
    if not good:
        raise InputError(f"{path}: locked = {locked!r}; allowed is {{ joint = angle in rad, or m }}")
    both = [name for name in locked if joints is not None and name in joints]
    if both:
        raise InputError(f"{path}: joint {both[0]!r} is among joints, which move, and among locked; keep one")
    if fix not in ("", "nearest"):
        raise InputError(f"{path}: inertia_fix = {fix!r}; allowed is 'nearest'")
    return Holding(
        None if joints is None else tuple(joints),
        {name: float(x) for name, x in locked.items()},
        "nearest" if fix else "",
    )
