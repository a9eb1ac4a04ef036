"""What the snare catches: a body with a pin, on a spring, on a pendulum, floating freely, or moved from outside."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError

Support = Literal["spring", "pendulum", "free", "moved"]
PAPER_POSITION = (0.2369, 0.0747, 0.0402)
"""Foot of the pin in the end effector's frame at the start of the ground test [m] (Li et al.)."""
PAPER_ORIENTATION = (0.9993, 0.0345, -0.0075, -0.0108)
"""Its orientation, quaternion w first (Li et al.)."""
PAPER_SPRING = 2042.5
"""Stiffness of the suspension spring [N/m] (Li et al., measured)."""


@dataclass(frozen=True)
class Target:
    """The captured body and what holds it.

    Parameters
    ----------
    support : "spring", "pendulum", "free" or "moved"
        ``spring``: hung from a fixed point by a line with a spring, at rest at the start. ``pendulum``: by a line that
        does not stretch. ``free``: floating, no gravity. ``moved``: its motion is an input.
    position : three floats
        The pin's foot in the world at the start [m].
    orientation : four floats
        Unit quaternion, w first; normalised here.
    velocity, angular_velocity : three floats
        At the start, in the world [m/s, rad/s].
    mass : float
        [kg]; unused where ``moved``.
    inertia : 3 × 3 floats or None
        About the centre of mass, in the target's axes [kg·m²]. None: the target keeps its orientation.
    centre_of_mass, hang_point : three floats
        In the target's frame [m]; a line is fixed to `hang_point`.
    line_length : float
        From the hang point to the fixed point above it, under load [m].
    stiffness, damping : float
        Of the spring [N/m, N·s/m].
    gravity : three floats
        In the world [m/s²], where a line holds the target.
    clearance : float
        Radius of the play at the line's top [m], see `line`; in the middle of it at the start.
    umbilical : float
        Stiffness of an extra cable that draws the pin's foot back to where it started [N/m], the same in every
        direction.

    Raises
    ------
    InputError
        For a mass, inertia, quaternion or line that cannot be.
    """

    support: Support
    position: Sequence[float] = PAPER_POSITION
    orientation: Sequence[float] = PAPER_ORIENTATION
    velocity: Sequence[float] = (0.0, 0.0, 0.0)
    angular_velocity: Sequence[float] = (0.0, 0.0, 0.0)
    mass: float = 25.0
    inertia: Sequence[Sequence[float]] | None = None
    centre_of_mass: Sequence[float] = (0.0, 0.0, 0.0)
    hang_point: Sequence[float] = (0.0, 0.0, 0.0)
    line_length: float = 2.0
    stiffness: float = PAPER_SPRING
    damping: float = 0.0
    gravity: Sequence[float] = (-9.81, 0.0, 0.0)
    clearance: float = 0.0
    umbilical: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        if self.support not in get_args(Support):
            raise InputError(f"target: support is '{self.support}'; give one of {', '.join(get_args(Support))}")
        for name in ("position", "velocity", "angular_velocity", "centre_of_mass", "hang_point", "gravity"):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.shape != (3,) or not np.all(np.isfinite(value)):
                raise InputError(f"target: {name} is {getattr(self, name)}; give three numbers")
            object.__setattr__(self, name, tuple(value.tolist()))
        object.__setattr__(self, "orientation", unit_quaternion(self.orientation, "target: orientation"))
        for name in ("mass", "line_length", "stiffness"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise InputError(f"target: {name} is {getattr(self, name)}; give a number > 0")
        for name in ("damping", "clearance", "umbilical"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise InputError(f"target: {name} is {getattr(self, name)}; give a number >= 0")
        if self.clearance > 0 and not self.hangs:
            raise InputError(f"target: clearance is {self.clearance:g} m, and no line holds it; give 0")
        if self.inertia is not None:
            self._check_inertia(np.asarray(self.inertia, dtype=float))

    def _check_inertia(self, inertia: np.ndarray) -> None:
        if inertia.shape != (3, 3) or not np.allclose(inertia, inertia.T):
            raise InputError(f"target: inertia is {self.inertia}; give a symmetric 3 x 3 matrix [kg*m**2]")
        principal = np.linalg.eigvalsh(inertia)
        if principal[0] <= 0 or principal[2] > principal[0] + principal[1]:
            raise InputError(
                f"target: inertia has principal moments {principal.tolist()}; "
                "give positive ones, none above the sum of the two others"
            )

    @property
    def rotates(self) -> bool:
        """Whether its orientation is part of the dynamics."""
        return self.inertia is not None and self.support != "moved"

    @property
    def hangs(self) -> bool:
        """Whether a line holds it."""
        return self.support in ("spring", "pendulum")


def unit_quaternion(orientation: ArrayLike, owner: str) -> tuple[float, ...]:
    """The quaternion, normalised; raises InputError where it has no direction or is not near unit length."""
    value = np.asarray(orientation, dtype=float)
    length = np.linalg.norm(value)
    if value.shape != (4,) or not abs(length - 1) < 1e-2:
        raise InputError(f"{owner} is {orientation}; give a unit quaternion, w first")
    return tuple((value / length).tolist())
