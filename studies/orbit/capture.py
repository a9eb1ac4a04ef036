"""What both studies of a capture in orbit do: run, hold against one system, vary, and write it down."""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...cosim.record import Run
from ...cosim.whole_capture import co_simulate_whole
from ...models.docking.parameters import DockingParameters
from ...models.inertia import Array
from ...models.snare.parameters import SnareParameters
from ..outcome import Quantity, table, write_result
from ..page import Section, write_page
from .docked import DockingRun, docked_of, is_latched
from .docked import measure as measure_docked
from .docked_figures import pictures
from .figures import PAPER_CONTACT, PAPER_Y, PAPER_Z, base_motion, displacement, forces, ledgers, passive_map
from .ledger import Momentum, energy_ledger, force_error, momentum_ledger, peak_force, position_error
from .map import Cell, resistance_map
from .reference import reference
from .scene import PHASES, add_phases, orbit_scene
from .setting import (
    DURATION,
    MACRO_STEP,
    SNARE,
    CaseName,
    JointResistance,
    OrbitCapture,
    Setting,
    capture_of,
    co_simulate,
    radial_end,
    setting,
    step_control,
)

_TITLES = {
    "inspection": "Capture of a pin on the arm's own base (Li et al., case 1)",
    "hover": "Capture of a target of 10 t that floats freely (Li et al., case 2)",
}


@dataclass(frozen=True)
class Result:
    """Everything that one study found; ``processor`` is the time [s] that equal steps and chosen ones took."""

    start: Setting
    run: Run
    capture: OrbitCapture
    processor: tuple[float, float]
    single: OrbitCapture
    single_momentum: Array
    controlled: Run
    controlled_capture: OrbitCapture
    narrow: OrbitCapture
    momentum: Momentum
    energies: dict[str, Array]
    cells: list[Cell]
    docked: DockingRun
    docked_processor: float


def study(case: CaseName) -> int:
    """Run a study; leaves page and numbers in ``build/studies/orbit-<case>``."""
    begun, name = time.monotonic(), f"orbit-{case}"
    frames: list[tuple[float, Array]] = []
    result = _run(case, name, frames)
    quantities = measure(result)
    _say(table(quantities))
    found = sentence(result)
    scene = orbit_scene(result.start, result.docked.capture, SNARE, frames)
    add_phases(scene, result.docked)
    path = write_page(
        name,
        _TITLES[case],
        found,
        quantities,
        _sections(result),
        scene.html(start=result.capture.first_contact or 0.0),
        "The snare at the arm's tip, through to the latch; the ball above it shows the program's state: "
        + ", ".join(f"{state} {colour}" for state, colour in PHASES.items())
        + ". Scroll out to see arm and base. Drag to turn, right button to shift.",
    )
    extra = {
        "found": found,
        "transitions": [str(event) for event in result.docked.whole.run.log],
        "rejected_steps": [str(event) for event in result.controlled.log],
    }
    write_result(name, quantities, time.monotonic() - begun, extra)
    _say(f"\n{found}\nReport: {path.resolve()}")
    return 0


def _run(case: CaseName, name: str, frames: list[tuple[float, Array]]) -> Result:
    start, passive = setting(case), JointResistance()
    _say(f"Capture of {DURATION:g} s, co-simulated in steps of {1e3 * MACRO_STEP:g} ms ...")
    marks = [time.process_time()]
    run = co_simulate(start, passive)
    marks.append(time.process_time())
    capture = capture_of(run, case)
    _say("  as one system ...")
    single, single_momentum = reference(start, passive, SNARE)
    _say("  with the step chosen by its error ...")
    marks.append(time.process_time())
    controlled = co_simulate(start, passive, control=step_control(start))
    marks.append(time.process_time())
    _say("  with the other set of sizes ...")
    narrow = capture_of(co_simulate(start, passive, SnareParameters(), step=2e-3, own_step=2e-3), case)
    _say("  with the whole end effector, to the latch ...")
    marks.append(time.process_time())
    whole = co_simulate_whole(start, passive, frames=frames)
    docking = time.process_time() - marks[-1]
    spent = marks[1] - marks[0], marks[3] - marks[2]
    return Result(
        start, run, capture, spent, single, single_momentum, controlled, capture_of(controlled, case), narrow,
        momentum_ledger(run, capture), energy_ledger(run, capture, start, passive),
        resistance_map(start, SNARE, name, _say), docked_of(whole), docking,
    )  # fmt: skip


def measure(result: Result) -> list[Quantity]:
    """The study's numbers; intervals span both sets of sizes and the map, and are no confidence.

    What the paper gives is *calibrated*: of the two sets of sizes that meet the ground test, the one was taken whose
    captures in orbit meet the paper. Final is the paper's 10 s; after rest is 0.5 s later, the ring having stopped at
    10.1 s.
    """
    c, cells, narrow = result.capture, result.cells, result.narrow
    contacts = [_contact(c), _contact(narrow), *(cell.first_contact for cell in cells)]
    touched = [x for x in contacts if np.isfinite(x)] or [0.0]
    ends = np.array([radial_end(c), radial_end(narrow), *((x.final_y, x.final_z) for x in cells)])
    peaks = [peak_force(c), peak_force(narrow), *(cell.peak_force for cell in cells)]
    total = result.single_momentum
    own = np.linalg.norm((total - total[0])[:, :3], axis=1).max() / result.momentum.scale[0]
    handed = result.energies["motor"] - result.energies["cables, strain"]
    residual = np.abs(result.energies["residual"]).max() / np.abs(handed).max()
    base = np.linalg.norm(c.base[:, 0] - c.base[0, 0], axis=1).max()
    spin = np.linalg.norm(c.base[:, 2], axis=1).max()
    controlled, chosen = result.controlled, result.controlled_capture
    return [
        Quantity(
            "first_contact", "s", contacts[0] if np.isfinite(contacts[0]) else "none", "calibrated", PAPER_CONTACT,
            min(touched), max(touched),
        ),
        Quantity("final_radial_y", "m", float(ends[0, 0]), "calibrated", PAPER_Y, *_range(ends[:, 0])),
        Quantity("final_radial_z", "m", float(ends[0, 1]), "calibrated", PAPER_Z, *_range(ends[:, 1])),
        Quantity("radial_y_after_rest", "m", float(c.relative[-1, 1]), "reference"),
        Quantity("radial_z_after_rest", "m", float(c.relative[-1, 2]), "reference"),
        Quantity("peak_force", "N", peaks[0], "reference", None, min(peaks), max(peaks)),
        Quantity("momentum_drift", "1", result.momentum.drift, "reference"),
        Quantity("momentum_drift_one_system", "1", float(own), "reference"),
        Quantity("error_to_monolithic", "m", position_error(c, result.single), "reference"),
        Quantity("force_error_to_monolithic", "1", force_error(c, result.single), "reference"),
        Quantity("energy_residual", "1", float(residual), "reference"),
        Quantity("base_moved", "m", float(base), "reference"),
        Quantity("base_rate", "rad/s", float(spin), "reference"),
        Quantity("steps", "1", result.run.steps, "reference"),
        Quantity("controlled_steps", "1", controlled.steps, "reference"),
        Quantity("controlled_rejected", "1", controlled.rejected, "reference"),
        Quantity("controlled_error_to_monolithic", "m", position_error(chosen, result.single), "reference"),
        Quantity("controlled_force_error", "1", force_error(chosen, result.single), "reference"),
        Quantity("real_time_factor", "1", DURATION / result.processor[0], "reference"),
        Quantity("controlled_real_time_factor", "1", DURATION / result.processor[1], "reference"),
        *measure_docked(
            result.docked, DockingParameters(), result.single, result.processor[0], result.docked_processor
        ),
    ]  # fmt: skip


def sentence(result: Result) -> str:
    """What the study found."""
    c = result.capture
    y, z = 1e3 * radial_end(c)
    inside = [x for x in result.cells if _inside(x)]
    return (
        f"First contact at {_contact(c):.2f} s (paper: about 7 s); the pin is {y:.1f} and {z:.1f} mm off the axis "
        f"after 10 s (paper: below 5 and 10 mm). Of the {len(result.cells)} resistances of the joints that were tried, "
        f"{len(inside)} end inside the paper's figures{_span(inside)}. Co-simulated and as one system, the pin's "
        f"places differ by {1e6 * position_error(c, result.single):.2g} µm at most. {_latched(result.docked)}"
    )


def _sections(result: Result) -> list[Section]:
    c = result.capture
    controlled = result.controlled
    events = [str(event) for event in controlled.log[:6]]
    energies, momenta = ledgers(c, result.energies, result.momentum)
    return [
        Section(
            "The capture",
            [
                "Two sets of the ring's sizes meet the paper's first contact in the ground study; this is the one "
                "whose captures in orbit meet the paper, too: chosen by these numbers, so that agreement proves "
                "nothing. Mass and size of base and target, the arm and the friction in its joints are chosen: the "
                "paper gives 40 t and 10 t, and no more.",
            ],
            [displacement(c, result.single), forces(c, result.single), base_motion(c)],
        ),
        Section(
            "On to the latch",
            [
                "Carriage, three balls in V-grooves and latches go on under a control program; no sizes, motors or "
                "preloads of a flight unit are published, so that all are chosen, but for the preload, which is "
                "calibrated to the published peaks of 5.38 to 5.66 kN. Transitions of the program:",
                *(str(event) for event in result.docked.whole.run.log),
            ],
            pictures(result.docked, DockingParameters()),
        ),
        Section(
            "What the joints' resistance decides",
            [
                "Joints that are driven backwards resist by friction, and perhaps by the stiffness of harness and "
                "gear. Friction here is the whole Makkar curve, scaled; its Coulomb level names it.",
                *(_said(cell) for cell in result.cells),
            ],
            [passive_map(result.cells)],
        ),
        Section("Energy and momentum", [], [energies, momenta]),
        Section(
            "Co-simulation and one system",
            [
                f"In equal steps of {1e3 * MACRO_STEP:g} ms: {result.run.steps} steps. With the step chosen by its "
                f"error: {controlled.steps} steps and {controlled.rejected} rejected and repeated. The log begins:",
                *events,
            ],
        ),
    ]


def _latched(d: DockingRun) -> str:
    """How the run to the latch ended."""
    good, why = is_latched(d, DockingParameters())
    if not good:
        return f"The whole end effector does not latch: {why}."
    (begin,) = [begin for state, begin, _ in d.whole.phases if state == "LATCHED"]
    return f"The whole end effector latches after {begin:.1f} s, all three balls in their seats."


def _inside(cell: Cell) -> bool:
    return abs(cell.final_y) < PAPER_Y and abs(cell.final_z) < PAPER_Z


def _span(cells: Sequence[Cell]) -> str:
    if not cells:
        return ""
    levels = [cell.level for cell in cells]
    return f", with friction of {min(levels):g} to {max(levels):g} N·m a joint"


def _said(cell: Cell) -> str:
    return (
        f"{cell.level:g} N·m and {cell.stiffness:g} N·m/rad: {1e3 * cell.final_y:.1f} and {1e3 * cell.final_z:.1f} mm, "
        f"peak {cell.peak_force:.1f} N."
    )


def _range(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _contact(capture: OrbitCapture) -> float:
    return np.inf if capture.first_contact is None else capture.first_contact


def _say(text: str) -> None:
    print(text, flush=True, file=sys.stdout)
