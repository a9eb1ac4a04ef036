"""The inspection capture as a case of a tolerance study: an arm on its 40 t base catches a pin on that base.

Li et al., case 1: the arm's motors are off from the moment of arrival, 20 mm off in each radial direction, 0.12 m away
and turned by 2 degrees about each axis. Snare and arm are co-simulated (`snarelab.cosim.orbit_capture`), the macro step
chosen by its error: a fifth of the processor time of equal steps, and the pin's place within 0.03 mm of theirs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from ..cosim.orbit_capture import (
    SNARE,
    CaseName,
    arrival,
    capture_of,
    co_simulate,
    columns,
    resistance,
    step_control,
)
from ..cosim.orbit_capture import (
    OrbitCapture as Motion,
)
from ..models.snare.parameters import SnareParameters
from .capture import Axis, Capture, Outcome, source_version
from .enclosure import runs_through, turned
from .ground import DURATION, WAIT
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
    WAIT,
)


@dataclass(frozen=True)
class SimulatedCapture:
    """One capture, simulated.

    Parameters
    ----------
    motion : Motion
    snare : SnareParameters
    frames : list of (float, array (3, n_nodes, 3))
        Time [s] and the cables' nodes in the world [m], fifteen times a second.
    tensions : list of float
        Largest force of a cable on its ring at each communication point [N].
    on_pin : array (n, 3)
        Impulse of the cables on the pin since the start [N·s].
    """

    motion: Motion
    snare: SnareParameters
    frames: list[tuple[float, np.ndarray]]
    tensions: list[float]
    on_pin: np.ndarray

    def seen(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the motion at the frames (n_frames,), and the cables there in the end effector's frame."""
        rows = np.searchsorted(self.motion.times, [time - 1e-9 for time, _ in self.frames])
        tip = self.motion.tip[rows]
        nodes = np.array([nodes for _, nodes in self.frames]) - tip[:, None, None, 0]
        return rows, np.einsum("tcni,tij->tcnj", nodes, tip[:, 3:])


def simulate(values: Mapping[str, float], case: CaseName = "inspection") -> SimulatedCapture:
    """The capture itself; raises InputError for a pin that starts inside a cable, StepError if a step breaks down."""
    turn = turned(values)
    foot = [AHEAD + values["axial"], values["radial_y"], values["radial_z"]]
    start = arrival(case, foot, turn, values["speed"])
    snare = SNARE.with_values(friction=values["friction"])
    frames: list[tuple[float, np.ndarray]] = []
    tensions: list[float] = []
    done = co_simulate(
        start,
        resistance(values["joint_friction"], values["joint_stiffness"]),
        snare,
        duration=DURATION + values["wait"],
        own_step=OWN_STEP,
        control=step_control(start, TOLERANCE, LARGEST),
        frames=frames,
        tensions=tensions,
    )
    motion = capture_of(done, case)
    # What a floating target gets is, but for the cables' own momentum, what the end effector does not.
    on_pin = columns(done.recording, "snare.impulse.pin") if case == "inspection" else -motion.impulse
    return SimulatedCapture(motion, snare, frames, tensions, on_pin)


def run(values: Mapping[str, float], case: CaseName = "inspection") -> Outcome:
    """One case; see `simulate`.

    Where the pin's foot gets into the mouth, the target would have met the ring, which is not modelled: no result.
    """
    done = simulate(values, case)
    motion = done.motion
    deepest = float(motion.relative[:, 0].min()) - done.snare.ring_distance
    if deepest < 0:
        return Outcome.failed(f"the pin's foot came {-1e3 * deepest:.2g} mm into the mouth: the target met the ring")
    forces = replace(motion, impulse=done.on_pin).mean_force(_WINDOW)[1]
    return Outcome(
        enclosed=_encloses(done),
        radial_error=float(np.abs(motion.relative[-1, 1:]).max()),
        first_contact=np.nan if motion.first_contact is None else motion.first_contact,
        peak_force=float(np.linalg.norm(forces, axis=1).max()),
        peak_tension=max(done.tensions),
    )


def _encloses(done: SimulatedCapture) -> bool:
    """At the last picture of the cables, which is at most 1/15 s before the end."""
    rows, cables = done.seen()
    last = rows[-1]
    axis = -done.motion.tip[last, 3:].T @ done.motion.pin[last, 3:, 0]
    return runs_through(cables[0], cables[-1], done.motion.relative[last], axis, done.snare)


def film(values: Mapping[str, float], case: CaseName = "inspection") -> str:
    """A page that plays the capture, as seen from the end effector."""
    from ..report.snare_scene import SceneData, snare_scene

    done = simulate(values, case)
    rows, cables = done.seen()
    tip, pin = done.motion.tip[rows, 3:], done.motion.pin[rows, 3:]
    attitude = Rotation.from_matrix(tip.transpose(0, 2, 1) @ pin).as_quat(canonical=True, scalar_first=True)
    seen = SceneData(done.motion.times[rows], done.motion.relative[rows], attitude, cables)
    return snare_scene(seen, done.snare).html(start=done.motion.first_contact or 0.0)


SOURCES = (
    "tolerance/inspection.py",
    "cosim/orbit_capture.py",
    "cosim/macro_step.py",
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

CAPTURE = Capture("inspection", AXES, run, source_version(*SOURCES), film)
HOVER = Capture("hover", AXES, partial(run, case="hover"), source_version(*SOURCES), partial(film, case="hover"))
"""Li et al., case 2: the same arrival at a target of 10 t that floats by itself."""
