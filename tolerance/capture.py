"""What a tolerance study varies and runs: one kind of capture, its variables, and what comes out of a case."""

import hashlib
import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError

_PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Axis:
    """One quantity that a study may vary.

    Parameters
    ----------
    name, unit, meaning : str
    nominal : float
        The value of a study that does not vary it [unit].
    low, high : float
        What the model is valid for [unit].
    """

    name: str
    unit: str
    meaning: str
    nominal: float
    low: float
    high: float


@dataclass(frozen=True)
class Outcome:
    """What one simulated capture gave.

    Parameters
    ----------
    enclosed : bool
        The pin is inside the closed snare at the end.
    radial_error : float
        Distance of the pin's axis from the snare's at the end [m].
    first_contact : float
        Time of first contact [s]; NaN where there was none.
    peak_force : float
        Largest contact force on the pin [N].
    peak_tension : float
        Largest cable tension [N].
    reason : str
        Empty, or why the case has no result: a step that diverged, a worker that was lost.
    latched : float
        Where the capture goes on to the latch: signed margin of that, -1 to 1; NaN where it does not.
    state : str
        In which the control program ended.
    """

    enclosed: bool
    radial_error: float
    first_contact: float
    peak_force: float
    peak_tension: float
    reason: str = ""
    latched: float = float("nan")
    state: str = ""

    @classmethod
    def failed(cls, reason: str) -> "Outcome":
        """A case without a result: a recorded outcome, and no success."""
        unknown = float("nan")
        return cls(False, unknown, unknown, unknown, unknown, reason)


@dataclass(frozen=True)
class Capture:
    """A kind of capture: its axes, and the function that runs one case in a worker process.

    ``run`` takes a value for every axis by name. It must give the same outcome for the same values, and may raise
    ArithmeticError or RuntimeError where the simulation breaks down.

    Parameters
    ----------
    name : str
    axes : tuple of Axis
    run : callable
    version : str
        Of the simulation. Cases of one version are not continued with another.
    film : callable, optional
        Takes the same values and gives a page that plays the capture.
    """

    name: str
    axes: tuple[Axis, ...]
    run: Callable[[Mapping[str, float]], Outcome]
    version: str = ""
    film: Callable[[Mapping[str, float]], str] | None = None

    def axis(self, name: str) -> Axis:
        """The axis of that name; raises KeyError."""
        return {a.name: a for a in self.axes}[name]


def run_case(capture: Capture, values: Mapping[str, float]) -> Outcome:
    """One case, in a worker: a simulation that breaks down is an outcome with its reason, not an error.

    It stands here so that a worker loads no more than the capture.
    """
    try:
        found = capture.run(values)
    except (ArithmeticError, RuntimeError, ValueError) as error:
        return Outcome.failed(" ".join(str(error).split())[:200] or type(error).__name__)
    if not isinstance(found, Outcome):
        raise InputError(f"{capture.name}: run gives a {type(found).__name__}; give an Outcome")
    if found.enclosed and not np.isfinite([found.radial_error, found.peak_tension]).all():
        return Outcome.failed(f"radial error {found.radial_error:g} m, tension {found.peak_tension:g} N: not finite")
    return found


BUILT_IN = {name: f"snarelab.tolerance.{name}:CAPTURE" for name in ("ground", "inspection")} | {
    "hover": "snarelab.tolerance.inspection:HOVER",
    "latched-ground": "snarelab.tolerance.latched_ground:CAPTURE",
    "latched-inspection": "snarelab.tolerance.latched:INSPECTION",
    "latched-hover": "snarelab.tolerance.latched:HOVER",
}
"""Captures by the name that a study file calls them."""


def source_version(*patterns: str) -> str:
    """Digest of snarelab's own files, ``models/snare/*.py`` and the like: a change of the physics gives another one."""
    digest = hashlib.sha256()
    for pattern in patterns:
        for source in sorted(_PACKAGE.glob(pattern)):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def find_capture(name: str) -> Capture:
    """A built-in capture by its name, or one of the user's own as ``package.module:NAME``.

    Raises InputError where there is none.
    """
    module, _, attribute = BUILT_IN.get(name, name).partition(":")
    if not attribute:
        raise InputError(f"capture = {name!r}; allowed are {', '.join(BUILT_IN)}, or your own as 'package.module:NAME'")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:  # the module is the user's own and may raise anything
        raise InputError(f"capture = {name!r} cannot be loaded: {error}; put its folder on PYTHONPATH") from None
    if not isinstance(found, Capture):
        raise InputError(
            f"capture = {name!r} is a {type(found).__name__}; it must be a snarelab.tolerance.capture.Capture"
        )
    return found
