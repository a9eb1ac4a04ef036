"""The end effector of the hover case, ready made: arm, carriage, docking, latches, and the target of 10 t."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...models.docking.arm import drive_with_carriage
from ...models.docking.parameters import DockingParameters
from ...models.floating.space_arm import CAPTURE_POSE, FRICTION, space_arm_drive
from ..orbit_capture import SNARE, arrival
from .end_effector import EndEffectorParticipant

MISALIGNED = (0.12, 0.02, 0.02), np.deg2rad(2.0)
"""The paper's: the pin's foot in the end effector's frame [m], and the turn about each axis [rad]."""


class HoverEndEffectorParticipant(EndEffectorParticipant):
    """`EndEffectorParticipant` on the space arm, at rest, with the paper's misalignment before it.

    Parameters
    ----------
    foot : tuple of three floats
        The pin's in the end effector's frame [m].
    tilt : float
        About each axis [rad].
    """

    def __init__(
        self, foot: tuple[float, float, float] = MISALIGNED[0], tilt: float = MISALIGNED[1], name: str = "effector"
    ) -> None:
        """Write and compile the equations."""
        start = arrival("hover", foot, Rotation.from_euler("xyz", [tilt] * 3))
        values = {
            f"makkar_friction.{joint.name}.{key}": value
            for joint in start.arm.tree.joints
            for key, value in FRICTION.items()
        }
        super().__init__(
            start.arm, start.target, drive_with_carriage(space_arm_drive(start.arm)), CAPTURE_POSE, start.rates,
            np.zeros(6), DockingParameters(), SNARE, values, name,
        )  # fmt: skip
