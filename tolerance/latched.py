"""Captures in orbit that go on to the latch: does it latch, and in which state does it end if it does not?

As `inspection`, with the whole end effector (`snarelab.cosim.whole_capture`). Success is the program's LATCHED with all
three balls in their seats, little left of the misalignment, a preload inside the published window and no cable over its
strength. The soft capture's own numbers, at the paper's 10 s, stand beside it: they are the proxy.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from ..cosim.docked import docked_of, margin
from ..cosim.orbit_capture import SNARE, CaseName, arrival, column, resistance
from ..cosim.whole_capture import co_simulate_whole
from ..models.docking.parameters import DockingParameters
from .capture import Axis, Capture, Outcome, source_version
from .inspection import AHEAD
from .inspection import AXES as ARRIVAL
from .inspection import SOURCES as ARRIVAL_SOURCES

END = 10.0
"""Of the soft capture, by the paper [s]."""
AXES = (
    *(a for a in ARRIVAL if a.name not in ("joint_stiffness", "wait")),
    Axis("docking_friction", "1", "Coulomb's, between ball and groove", 0.15, 0.0, 0.4),
)


def run(values: Mapping[str, float], case: CaseName) -> Outcome:
    """One case, to its end; raises InputError for a pin that starts inside a cable."""
    turn = Rotation.from_euler("xyz", [values["roll"], values["pitch"], values["yaw"]])
    start = arrival(case, [AHEAD + values["axial"], values["radial_y"], values["radial_z"]], turn, values["speed"])
    docking = DockingParameters(friction=values["docking_friction"])
    snare = SNARE.with_values(friction=values["friction"])
    whole = co_simulate_whole(start, resistance(values["joint_friction"]), snare, docking)
    if whole.fault and whole.final == "CLOSE":
        return Outcome.failed(whole.fault)
    d = docked_of(whole)
    row = min(int(np.searchsorted(d.times, END - 1e-9)), len(d.times) - 1)
    forces = d.capture.mean_force(0.01)[1]
    soft = d.times <= END
    return Outcome(
        enclosed=bool(column(whole.run.recording, "effector.enclosed")[row]),
        radial_error=float(np.abs(d.capture.relative[row, 1:]).max()),
        first_contact=np.nan if d.capture.first_contact is None else d.capture.first_contact,
        peak_force=float(np.linalg.norm(forces, axis=1).max()),
        peak_tension=float(d.tension[soft].max()),
        latched=margin(d, docking),
        state=whole.final,
    )


SOURCES = (
    "tolerance/latched.py",
    "cosim/docked.py",
    "cosim/whole_capture.py",
    "cosim/state_table.py",
    "cosim/programs/*.toml",
    "cosim/participants/end_effector.py",
    "cosim/participants/control_program.py",
    "models/docking/*.py",
    *ARRIVAL_SOURCES,
)
"""What the outcome of a case follows from."""

INSPECTION = Capture("latched-inspection", AXES, partial(run, case="inspection"), source_version(*SOURCES))
HOVER = Capture("latched-hover", AXES, partial(run, case="hover"), source_version(*SOURCES))
