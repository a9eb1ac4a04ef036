"""Which captures along single directions a study asks for: the table ``[envelope]`` of its file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError
from .given import flag, known

PARTS = (1, 2, 4, 8, 16, 32, 64)
"""Into how many parts a way may be divided."""
_ENVELOPE = ("axes", "steps", "exact")


@dataclass(frozen=True)
class Ways:
    """Which captures along single axes are run; see `rays`.

    Parameters
    ----------
    axes : tuple of str, optional
        Along which; None: every varied one.
    steps : int
        Equal steps in which a way is gone outwards, until one fails.
    exact : int
        Into how many parts of the way the last one is halved.
    """

    axes: tuple[str, ...] | None = None
    steps: int = 8
    exact: int = 64


def read_ways(path: Path, raw: Mapping[str, Any], ranges: Mapping[str, Any]) -> Ways | None:
    """The study file's ``envelope``: true, false or a table; None where no way is gone."""
    given = raw.get("envelope", True)
    if not isinstance(given, dict):
        return Ways() if flag(path, given, "envelope", " or a table [envelope]") else None
    known(path, "envelope", given, _ENVELOPE)
    axes = given.get("axes")
    if axes is not None:
        if not (isinstance(axes, list) and axes):
            raise InputError(f"{path}: [envelope] axes = {axes!r}; allowed is a list of names of [ranges]")
        for axis in axes:
            if axis not in ranges:
                raise InputError(f"{path}: [envelope] axes has {axis!r}; allowed are {', '.join(ranges)}")
        axes = tuple(axes)
    steps, exact = given.get("steps", Ways.steps), given.get("exact", Ways.exact)
    for key, value in (("steps", steps), ("exact", exact)):
        if isinstance(value, bool) or value not in PARTS:
            raise InputError(f"{path}: [envelope] {key} = {value!r}; allowed are {', '.join(map(str, PARTS))}")
    if exact < steps:
        raise InputError(f"{path}: [envelope] exact = {exact} is below steps = {steps}; give as much or more")
    return Ways(axes, steps, exact)
