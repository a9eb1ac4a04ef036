"""The ground test that goes on to the latch; see `latched`."""

from collections.abc import Mapping

import numpy as np

from ..cosim.ground_capture import PROGRAM, ground
from ..cosim.state_table import read_table
from ..models.snare.parameters import SnareParameters
from ..models.snare.target import PAPER_POSITION
from .capture import Capture, Outcome, source_version
from .ground import AXES as HUNG
from .latched import SEAT, SOURCES, outcome, turned

SCALE = 0.25
"""Of the orbit studies' macro steps: cables that hug the pin of a target of 25 kg are stable up to some 2 ms."""
AXES = (*(a for a in HUNG if a.name != "wait"), SEAT)


def run(values: Mapping[str, float]) -> Outcome:
    """One case, to its end; raises InputError for a pin that starts inside a cable."""
    position = (PAPER_POSITION[0] + values["axial"], values["radial_y"], values["radial_z"])
    w, x, y, z = np.roll(turned(values).as_quat(canonical=True), 1)
    start = ground(position, (w, x, y, z), values["speed"], values["target_mass"])
    return outcome(start, SnareParameters(), values, table=read_table(PROGRAM), scale=SCALE)


_OWN = ("tolerance/latched_ground.py", "tolerance/ground.py", "cosim/ground_capture.py", "cosim/programs/ground.toml")
CAPTURE = Capture("latched-ground", AXES, run, source_version(*_OWN, "models/hung.py", *SOURCES))
