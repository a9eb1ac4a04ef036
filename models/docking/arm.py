"""An arm whose end effector has a carriage: one more joint, which slides along −x of the tip's frame."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ..floating.arm import FloatingArm
from ..floating.joint_drive import Drive
from ..inertia import Array, from_central, is_physical, transform
from ..tree import Joint, Link
from .parameters import DockingParameters

CARRIAGE = "carriage"
_RADIUS, _LENGTH = 0.13, 0.12
"""Of the carriage as a uniform cylinder behind the fixed ring [m], chosen."""


def carriage_inertia(mass: float) -> Array:
    """Parameters phi (10,) of the carriage about its frame, whose origin is the fixed ring's middle."""
    across = mass * (3 * _RADIUS**2 + _LENGTH**2) / 12
    return from_central(mass, [-_LENGTH / 2, 0, 0], np.diag([0.5 * mass * _RADIUS**2, across, across]))


def drive_with_carriage(drive: Drive) -> Drive:
    """The joints' drive for `with_carriage`'s tree: its servo leaves the carriage alone."""

    def padded(gains: ArrayLike | None) -> Array | None:
        return None if gains is None else np.append(np.asarray(gains, float), 0.0)

    return replace(drive, stiffness=padded(drive.stiffness), damping=padded(drive.damping))


def with_carriage(arm: FloatingArm, p: DockingParameters) -> FloatingArm:
    """The arm with joint `CARRIAGE`; the tip stays on the last link, which gives the carriage's mass up.

    Raises
    ------
    InputError
        Where the last link is not heavy enough for that.
    """
    tree, i = arm.tree, arm.tip_link
    phi = carriage_inertia(p.carriage_mass)
    left = tree.links[i].phi - transform(phi, arm.tip_rotation, arm.tip_translation)
    if not is_physical(left):
        raise InputError(
            f"{tree.name}: a carriage of {p.carriage_mass:g} kg is no part of '{tree.links[i].name}' of "
            f"{tree.links[i].phi[0]:g} kg; take a lighter one"
        )
    links = [*tree.links, Link(CARRIAGE, phi)]
    links[i] = Link(links[i].name, left)
    slide = Joint(CARRIAGE, "prismatic", np.array([-1.0, 0, 0]), i, arm.tip_rotation, arm.tip_translation)
    return replace(arm, tree=replace(tree, joints=(*tree.joints, slide), links=tuple(links)))
