"""Two captures in orbit: a snare on a passive arm of a 40 t base, co-simulated step by step.

Li et al. (soft capture by the end effector of a space manipulator, 3-D ANCF cables), last section: case 1, inspection,
catches a pin on the arm's own base; case 2, hover, a target of 10 t that floats by itself. Both start 20 mm off in each
radial direction, 0.12 m ahead, and turned by 2° about each axis. How they are simulated stands in
`snarelab.cosim.orbit_capture`, whose names are here again for those who write a study.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ...cosim.orbit_capture import (
    DURATION,
    MACRO_STEP,
    SNARE,
    TARGET_SIDE,
    CaseName,
    JointResistance,
    OrbitCapture,
    Setting,
    arrival,
    capture_of,
    co_simulate,
    column,
    columns,
    resistance,
    step_control,
    system,
)
from ...models.inertia import Array

__all__ = [
    "AHEAD",
    "DURATION",
    "END",
    "MACRO_STEP",
    "OFFSET",
    "SNARE",
    "TARGET_SIDE",
    "TILT",
    "CaseName",
    "JointResistance",
    "OrbitCapture",
    "Setting",
    "capture_of",
    "co_simulate",
    "column",
    "columns",
    "radial_end",
    "resistance",
    "setting",
    "step_control",
    "system",
]  # fmt: skip

OFFSET, AHEAD, TILT = 0.02, 0.12, np.deg2rad(2.0)
"""Start of the pin's foot in the end effector's frame: radial, each way, and axial [m]; turn about each axis [rad]."""

END = 10.0
"""Of a soft capture, by the paper: 80° at 8°/s [s]."""


def setting(case: CaseName, offset: float = OFFSET, ahead: float = AHEAD, tilt: float = TILT) -> Setting:
    """Base at the world's origin, everything at rest; lengths in m, tilt in rad."""
    return arrival(case, [ahead, offset, offset], Rotation.from_euler("xyz", [tilt, tilt, tilt]))


def radial_end(capture: OrbitCapture) -> Array:
    """Radial displacement of the pin's foot at the paper's end, `END` (2,) [m]; of a shorter capture, at its own."""
    row = min(int(np.searchsorted(capture.times, END - 1e-9)), len(capture.times) - 1)
    return capture.relative[row, 1:]
