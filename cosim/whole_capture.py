"""The whole end effector on the arm of `orbit_capture`: snare, rigid docking and control program, to the latch.

Three participants. The snare follows carriage and pin; arm, carriage, docking, latches and target are one stiff
equation, which gets the cables' impulses; the control program reads sensors and commands, 100 times a second.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..models.docking.arm import drive_with_carriage
from ..models.docking.parameters import DockingParameters
from ..models.floating.dynamics import momentum
from ..models.floating.space_arm import space_arm_drive
from ..models.inertia import Array
from ..models.snare.model import Accuracy
from ..models.snare.parameters import SnareParameters
from ..models.snare.target import Target
from ..recordings.signals import pose_names
from .master import Master
from .orbit_capture import SNARE, JointResistance, Setting
from .participant import StepError
from .participants.control_program import ControlProgram
from .participants.end_effector import EndEffectorParticipant
from .participants.snare_commanded import CommandedSnareParticipant
from .record import Run
from .state_table import StateTable
from .system import System

SIZES = dict.fromkeys(("PULL", "SEAT", "BACK_OFF", "UNLOAD"), 2.5e-3) | dict.fromkeys(("SETTLE", "SNUG", "SLIDE"), 1e-2)
"""Macro steps by the program's state [s]: short where bodies meet or part, long where slack cables slide; `USUAL`
in all others."""
USUAL = 5e-3
TOUCHING = 1e-3
"""Longest macro step in the program's first state, in which the ring closes, while cables touch [s]. What a light touch
hands over steers arm and target until the next one; from steps of 5 ms they are 12 µm off by then."""
AFTER = 1.0
"""How long a run goes on in its last state [s]."""


def connections() -> list[tuple[str, str]]:
    """Between ``snare``, ``effector`` and ``program``: the source's output, the target's input."""
    links: list[tuple[str, str]] = []
    for ours, theirs in (("carriage", "effector"), ("pin", "pin")):
        both = zip(pose_names(ours), pose_names(theirs), strict=True)
        links += [(f"effector.{here}", f"snare.{there}") for here, there in both]
        links += [
            (f"snare.{kind}.{theirs}.{axis}", f"effector.{kind}.{ours}.{axis}")
            for kind in ("impulse", "angular_impulse")
            for axis in "xyz"
        ]
    links += [(f"program.{name}", f"effector.{name}") for name in ("speed", "motor", "brake", "latch", "servo")]
    links += [("program.rate.ring", "snare.rate.ring")]
    links += [(f"snare.{name}", f"program.{name}") for name in ("angle.ring", "torque.ring")]
    links += [("snare.touching", "program.cables_touching")]
    links += [
        (f"effector.{name}", f"program.{name}")
        for name in ("travel", "rate", "gap", "force.motor", "force.wrist.x", "force.wrist.y", "force.wrist.z",
                     "switches", "closed", "enclosed", "touching")
    ]  # fmt: skip
    return links


def whole_system(
    start: Setting,
    passive: JointResistance,
    snare: SnareParameters,
    docking: DockingParameters,
    table: StateTable | None,
    own_step: float,
) -> System:
    """Snare, arm with docking, and program, connected."""
    arm = start.arm
    total = momentum(arm, np.array([start.pose]), start.drift[None], start.rates[None])[0]  # base at the origin
    drive = drive_with_carriage(space_arm_drive(arm, pose=start.pose))
    values = {
        f"makkar_friction.{joint.name}.{key}": value
        for joint in arm.tree.joints
        for key, value in passive.friction.items()
    }
    t = start.target
    moved = Target("moved", t.position, t.orientation, t.velocity, t.angular_velocity)
    participants = {
        "snare": CommandedSnareParticipant(
            snare, moved, Accuracy(own_step, 10, 5e-4, snare.cable_radius), start.effector
        ),
        "effector": EndEffectorParticipant(arm, t, drive, start.pose, start.rates, total, docking, snare, values),
        "program": ControlProgram(table),
    }
    return System(participants, connections(), name=start.case)


@dataclass(frozen=True)
class WholeRun:
    """A run to its end: the recording, the states' names, the transitions' lines, and what stopped it early, if
    anything did."""

    run: Run
    states: tuple[str, ...]
    final: str
    fault: str = ""

    @property
    def phases(self) -> list[tuple[str, float, float]]:
        """State, begin and end [s], in order."""
        times = self.run.recording["time"].to_numpy()
        numbers = np.asarray(_column(self.run, "program.state"), int)
        edges = [0, *(np.flatnonzero(np.diff(numbers)) + 1), len(times) - 1]
        return [(self.states[numbers[a]], float(times[a]), float(times[b])) for a, b in pairwise(edges)]


def co_simulate_whole(
    start: Setting,
    passive: JointResistance | None = None,
    snare: SnareParameters | None = None,
    docking: DockingParameters | None = None,
    table: StateTable | None = None,
    *,
    longest: float = 120.0,
    scale: float = 1.0,
    own_step: float = 2e-3,
    frames: list[tuple[float, Array]] | None = None,
    disturb: Callable[[float, "Master"], None] | None = None,
    until: Collection[str] = (),
    sizes: Mapping[str, float] | None = None,
    touching: float = TOUCHING,
) -> WholeRun:
    """Run until `AFTER` past the program's last transition into a state that nothing leaves, ``longest`` [s] at most.

    It ends, too, where the program comes to a state of ``until``.

    Macro steps are `SIZES`, or ``sizes`` where that has the state, times ``scale``, and no longer than ``touching``
    [s] where `TOUCHING` says so; ``own_step`` [s] is that inside the snare while cables touch. ``frames`` is filled as
    by `co_simulate`; ``disturb`` is called each period of the program with the time and the master.
    """
    coupled = whole_system(
        start, passive or JointResistance(), snare or SNARE, docking or DockingParameters(), table, own_step
    )
    program: Any = coupled.participants["program"]
    model: Any = coupled.participants["snare"]

    fault, steps = "", SIZES | dict(sizes or {})
    with Master(coupled, USUAL, scheme="gauss_seidel", hold="quadratic") as master:

        def ready(time: float) -> None:
            """Film, and set the next step."""
            if frames is not None and time >= len(frames) / 15:
                frames.append((time, model.cables()))
            size = scale * steps.get(program.state, USUAL)
            touches = program.state == program.table.start and master.value("snare.touching") > 0
            master.set_step(min(size, touching) if touches else size)

        ended = None
        while master.time < longest - 1e-9 and (ended is None or master.time < ended + AFTER - 1e-9):
            ready(master.time)
            if disturb:
                disturb(master.time, master)
            try:
                master.go_to(program.next_event(master.time), ready)
            except StepError as error:
                fault = str(error)
                break
            here = program.table.states[program.state]
            if program.state in until:
                break
            if ended is None and not here.leave and not here.timeout:
                ended = master.time
        return WholeRun(master.result(), program.table.names, program.state, fault)


def _column(run: Run, name: str) -> Array:
    table = run.recording
    return table[next(key for key in table.variables if str(key).partition(" ")[0] == name)].to_numpy()
