"""A joint's axis that is reversed in the robot's file: position and torque both count the other way."""

import numpy as np

from ..case import CheckCase
from ..finding import Kind
from ..reading import Reading


def readings(case: CheckCase) -> list[Reading]:
    """Each joint with its axis reversed."""
    found = []
    for j in case.doubtful:
        joint, turned = case.joints[j], np.ones(len(case.joints))
        turned[j] = -1.0
        axis = " ".join(f"{-x:.6g}" for x in case.tree.joints[j].axis + 0.0)
        made = case.reading(
            "geometry",
            [joint],
            f'the axis of {joint} points the other way than in the URDF (mend it there: <axis xyz="{axis}"/>, or here)',
            ["\n".join(case.mends.scaled(f"{family}.{joint}", -1.0) for family in ("q", "tau"))],
        )
        found.append(made.but(factor=turned, torque_factor=turned))
    return found


KIND = Kind("geometry", "a joint's axis is not where the robot's file has it", readings)
