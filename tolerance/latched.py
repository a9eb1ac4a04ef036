"""Captures that go on to the latch: does it latch, and in which state does the program give up if it does not?

As `inspection`, with the whole end effector (`snarelab.cosim.whole_capture`). Success is the program's
LATCHED with all three balls in their seats, little left of the misalignment, a preload inside the published window and
no cable over its strength. The soft capture's own numbers, at the paper's 10 s, stand beside it: they are the proxy.
A case ends where the program gives up: the way out from each state has its own tests.
"""

from collections.abc import Mapping
from functools import partial

import numpy as np

from ..cosim.docked import docked_of, margin
from ..cosim.orbit_capture import SNARE, CaseName, JointResistance, Setting, arrival, column, resistance
from ..cosim.state_table import StateTable
from ..cosim.whole_capture import WholeRun, co_simulate_whole
from ..models.docking.parameters import DockingParameters
from ..models.snare.parameters import SnareParameters
from .capture import Axis, Capture, Outcome, source_version
from .enclosure import turned
from .inspection import AHEAD
from .inspection import AXES as ARRIVAL
from .inspection import SOURCES as ARRIVAL_SOURCES

END = 10.0
"""Of the soft capture, by the paper [s]."""
SCALE, TOUCHING = 1.5, 5e-3
"""Of the orbit studies' macro steps, which are for their energies, and the longest while cables touch [s], which there
is for micrometres: two thirds of the processor time."""
WAY_OUT = ("OPEN", "UNLOAD")
"""States with which the program gives up."""
SEAT = Axis("docking_friction", "1", "Coulomb's, between ball and groove", 0.15, 0.0, 0.4)
AXES = (*(a for a in ARRIVAL if a.name not in ("joint_stiffness", "wait")), SEAT)


def in_orbit(values: Mapping[str, float], case: CaseName) -> Outcome:
    """One case in orbit, to its end; raises InputError for a pin that starts inside a cable."""
    start = arrival(
        case, [AHEAD + values["axial"], values["radial_y"], values["radial_z"]], turned(values), values["speed"]
    )
    return outcome(start, SNARE, values, passive=resistance(values["joint_friction"]))


def outcome(
    start: Setting,
    snare: SnareParameters,
    values: Mapping[str, float],
    *,
    passive: JointResistance | None = None,
    table: StateTable | None = None,
    scale: float = SCALE,
    sizes: Mapping[str, float] | None = None,
) -> Outcome:
    """One case from where everything stands; the rest as of `co_simulate_whole`."""
    docking = DockingParameters(friction=values["docking_friction"])
    rubbing = snare.with_values(friction=values["friction"])
    whole = co_simulate_whole(
        start, passive, rubbing, docking, table, scale=scale, sizes=sizes, touching=TOUCHING, until=WAY_OUT
    )
    if whole.fault:
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
        state=ended_in(whole),
    )


def ended_in(whole: WholeRun) -> str:
    """The program's last state; where it gave up, that in which it did."""
    path = [state for state, _, _ in whole.phases] + [whole.final]
    return next(state for state in reversed(path) if state not in WAY_OUT)


SOURCES = (
    "tolerance/latched.py",
    "cosim/docked.py",
    "cosim/whole_capture.py",
    "cosim/state_table.py",
    "cosim/programs/end_effector.toml",
    "cosim/participants/end_effector.py",
    "cosim/participants/control_program.py",
    "models/docking/*.py",
    *ARRIVAL_SOURCES,
)
"""What the outcome of a case follows from."""

INSPECTION = Capture("latched-inspection", AXES, partial(in_orbit, case="inspection"), source_version(*SOURCES))
HOVER = Capture("latched-hover", AXES, partial(in_orbit, case="hover"), source_version(*SOURCES))
