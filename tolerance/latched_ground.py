"""The ground test that goes on to the latch; see `latched`."""

from collections.abc import Mapping

from ..cosim.ground_capture import PROGRAM, ground
from ..cosim.state_table import read_table
from ..models.snare.parameters import SnareParameters
from ..models.snare.target import PAPER_POSITION
from .capture import Capture, Outcome, source_version
from .enclosure import turned
from .ground import AXES as HUNG
from .latched import SEAT, SOURCES, outcome

SCALE = 0.25
SIZES = {"CLOSE": 2.5e-3} | dict.fromkeys(("SETTLE", "SNUG", "SLIDE"), 5e-3)
SIZES |= dict.fromkeys(("PRELOAD", "LATCH", "LATCHED"), 2e-3)
"""Of the macro steps, and those [s] that differ from the orbits': the cables that hug its pin are coupled in steps to a
target of 25 kg. Slack, that rings from 2 ms on; taut, as carriage and grooves press it, in 1.25 ms and not in 0.5."""
AXES = (*(a for a in HUNG if a.name != "wait"), SEAT)


def run(values: Mapping[str, float]) -> Outcome:
    """One case, to its end; raises InputError for a pin that starts inside a cable."""
    position = (PAPER_POSITION[0] + values["axial"], values["radial_y"], values["radial_z"])
    w, x, y, z = turned(values).as_quat(canonical=True, scalar_first=True)
    start = ground(position, (w, x, y, z), values["speed"], values["target_mass"])
    return outcome(start, SnareParameters(), values, table=read_table(PROGRAM), scale=SCALE, sizes=SIZES)


_OWN = ("tolerance/latched_ground.py", "tolerance/ground.py", "cosim/ground_capture.py", "cosim/programs/ground.toml")
CAPTURE = Capture("latched-ground", AXES, run, source_version(*_OWN, "models/hanging.py", *SOURCES))
