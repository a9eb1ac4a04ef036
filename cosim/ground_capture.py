"""The ground test of Li et al. for the whole end effector: fixed to a stand, its target hung from a spring.

The stand is a base and one joint so heavy that they do not move. The target hangs by its middle from the paper's
spring, and a cradle holds its attitude, as the paper's test does, but gives way, as a docking must let it.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..models.floating.arm import FloatingArm
from ..models.inertia import from_central
from ..models.snare.drive import Pose
from ..models.snare.target import PAPER_ORIENTATION, PAPER_POSITION, Target
from ..models.tree import Joint, Link, Tree
from .orbit_capture import Setting

STAND = 1e12
"""Of base and joint each [kg, kg·m²], chosen: the suspension's 500 N move them by a micrometre in a minute."""
SIDE = 0.4
"""Of the target, a uniform cube with the pin in a face's middle, hung by its middle [m], chosen."""
PROGRAM = Path(__file__).parent / "programs" / "ground.toml"
"""The control program with the forces and times of a target that a spring draws back."""


def stand() -> FloatingArm:
    """The stand of the end effector: its tip is the world's origin."""
    phi = from_central(STAND, np.zeros(3), STAND * np.eye(3))
    joint = Joint("stand", "revolute", np.array([1.0, 0, 0]), -1, np.eye(3), np.zeros(3), speed=1.0)
    return FloatingArm(Tree("stand", (joint,), (Link("stand", phi),), np.zeros(3)), phi, 0)


def ground(
    position: Sequence[float] = PAPER_POSITION,
    orientation: Sequence[float] = PAPER_ORIENTATION,
    speed: float = 0.0,
    mass: float = 25.0,
) -> Setting:
    """Positions of all bodies at the start.

    Parameters
    ----------
    position, orientation : three floats, four floats
        The pin's foot in the end effector's frame [m], and the target's attitude, quaternion w first.
    speed : float
        Of the target towards the end effector [m/s].
    mass : float
        Of the target [kg].
    """
    inertia = np.eye(3) * mass * SIDE**2 / 6
    middle = (SIDE / 2, 0.0, 0.0)
    target = Target(
        "spring", position, orientation, velocity=(-speed, 0.0, 0.0), mass=mass, inertia=inertia.tolist(),
        centre_of_mass=middle, hang_point=middle,
    )  # fmt: skip
    still = Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))
    return Setting("ground", stand(), still, target, np.zeros(1), np.zeros(6), np.zeros(1))
