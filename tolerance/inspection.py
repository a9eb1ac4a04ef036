"""The inspection capture as a case of a tolerance study: an arm on its 40 t base catches a pin on that base.

Li et al., case 1: the arm's motors are off from the moment of arrival, 20 mm off in each radial direction, 0.12 m away
and turned by 2 degrees about each axis. Snare and arm are co-simulated (`snarelab.cosim.orbit_capture`), the macro step
chosen by its error: a fifth of the processor time of equal steps, and the pin's place within 0.03 mm of theirs.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..cosim.orbit_capture import (
    SNARE,
    arrival,
    capture_of,
    co_simulate,
    columns,
    resistance,
    step_control,
)
from ..cosim.orbit_capture import (
    Capture as Motion,
)
from ..models.snare.parameters import SnareParameters
from .capture import Axis, Capture, Outcome, source_version
from .enclosure import runs_through
from .ground import SOURCES as SNARE_SOURCES

AHEAD = 0.12
"""From the end effector's origin to the pin's foot in the paper [m]."""
TOLERANCE, LARGEST, OWN_STEP = 0.05, 16e-3, 2e-3
"""Of the macro step: its error against the sizes of `step_control`; its and the snare's own longest step [s]."""
_WINDOW = 0.01
"""Over which the force on the pin is averaged before its peak is taken [s]."""

AXES = (
    Axis("radial_y", "m", "offset of the pin's foot", 0.0, -0.1, 0.1),
    Axis("radial_z", "m", "offset of the pin's foot", 0.0, -0.1, 0.1),
    Axis("axial", "m", "pin's foot farther away than in the paper", 0.0, -0.02, 0.1),
    Axis("roll", "rad", "about the snare's axis", 0.0, -np.pi, np.pi),
    Axis("pitch", "rad", "about y, after roll", 0.0, -0.5, 0.5),
    Axis("yaw", "rad", "about z, after pitch", 0.0, -0.5, 0.5),
    Axis("speed", "m/s", "of the end effector towards the pin on arrival", 0.0, 0.0, 0.03),
    Axis("friction", "1", "Coulomb's, between cable and pin", 0.1, 0.0, 0.5),
    Axis("joint_friction", "N*m", "Coulomb level of each joint, its other friction in proportion", 10.0, 1.0, 100.0),
    Axis("joint_stiffness", "N*m/rad", "of a spring that holds each joint where it was", 0.0, 0.0, 1e4),
)


def run(values: Mapping[str, float]) -> Outcome:
    """One case; raises InputError for a pin that starts inside a cable, StepError where a step breaks down.

    Where the pin's foot gets into the mouth, the target would have met the ring, which is not modelled: no result.
    """
    turn = Rotation.from_euler("xyz", [values["roll"], values["pitch"], values["yaw"]])
    foot = [AHEAD + values["axial"], values["radial_y"], values["radial_z"]]
    start = arrival("inspection", foot, turn, values["speed"])
    snare = SNARE.with_values(friction=values["friction"])
    frames: list[tuple[float, np.ndarray]] = []
    tensions: list[float] = []
    done = co_simulate(
        start,
        resistance(values["joint_friction"], values["joint_stiffness"]),
        snare,
        own_step=OWN_STEP,
        control=step_control(start, TOLERANCE, LARGEST),
        frames=frames,
        tensions=tensions,
    )
    motion = capture_of(done, "inspection")
    deepest = float(motion.relative[:, 0].min()) - snare.ring_distance
    if deepest < 0:
        return Outcome.failed(f"the pin's foot came {-1e3 * deepest:.2g} mm into the mouth: the target met the ring")
    on_pin = replace(motion, impulse=columns(done.recording, "snare.impulse.pin")).mean_force(_WINDOW)[1]
    return Outcome(
        enclosed=_encloses(motion, frames, snare),
        radial_error=float(np.abs(motion.relative[-1, 1:]).max()),
        first_contact=np.nan if motion.first_contact is None else motion.first_contact,
        peak_force=float(np.linalg.norm(on_pin, axis=1).max()),
        peak_tension=max(tensions),
    )


def _encloses(motion: Motion, frames: list[tuple[float, np.ndarray]], snare: SnareParameters) -> bool:
    """At the last picture of the cables, which is at most 1/15 s before the end."""
    last = int(np.searchsorted(motion.times, frames[-1][0] - 1e-9))
    first, cables = (
        (nodes - motion.tip[row, 0]) @ motion.tip[row, 3:] for row, (_, nodes) in ((0, frames[0]), (last, frames[-1]))
    )
    axis = -motion.tip[last, 3:].T @ motion.pin[last, 3:, 0]
    return runs_through(first, cables, motion.relative[last], axis, snare)


SOURCES = (
    "tolerance/inspection.py",
    "cosim/orbit_capture.py",
    "cosim/master.py",
    "cosim/sweep.py",
    "cosim/hold.py",
    "cosim/step_control.py",
    "cosim/participants/snare*.py",
    "cosim/participants/floating_arm.py",
    "models/dormand_prince.py",
    "models/floating/*.py",
    "models/effects/makkar*.py",
    *SNARE_SOURCES,
)
"""What the outcome of a case follows from."""

CAPTURE = Capture("inspection", AXES, run, source_version(*SOURCES))
