"""The suspended ground test of a snare: a pin on a spring, 85 mm off, caught in ten seconds.

Li et al. (soft capture by the end effector of a space manipulator, 3-D ANCF cables) hang a target on a spring, set it
off the axis, and close the snare on it. They state the spring, the cables' material, the start pose and the ring's
rate, but no size of rings, pin and cables, nor the target's mass. Some of these are calibrated to their first contact;
friction, damping and mass are varied to show what the rest leaves open.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..exit_status import status_of
from ..models.snare.history import SnareHistory
from ..models.snare.model import SnareModel
from ..models.snare.parameters import WIDE_RING, SnareParameters
from ..models.snare.target import Target
from ..report.snare_scene import SceneData, snare_scene
from .ground_capture_figures import sections
from .outcome import Quantity, table, write_result
from .page import write_page

STUDY = "ground-capture"
DURATION = 10.0
"""Length of the test [s] (Li et al.)."""
PAPER_CONTACT, PAPER_OFFSET = 2.6, 0.01
"""First contact [s]; both radial offsets end below this [m]."""
PAPER_POSITION_ERROR, PAPER_FORCE_ERROR = (0.00027, 0.00268, 0.00599), (0.99, 1.48, 2.12)
"""Mean absolute difference of their simulation and their experiment along x, y, z [m, N]."""
SWEEPS = {
    "friction": (0.0, 0.05, 0.1, 0.2, 0.3),
    "bending_damping": (1e-4, 3e-4, 1e-3, 3e-3, 1e-2),
    "end_friction": (5e-4, 1e-3, 2e-3, 4e-3),
    "mass": (10.0, 25.0, 50.0, 100.0),
}
"""What the paper leaves open: coefficient [1], ratio of damping to stiffness [s], friction of the cables' bearings
[N·m·s/rad], target's mass [kg]."""


@dataclass(frozen=True)
class GroundCase:
    """One capture of the study.

    Parameters
    ----------
    name : str
        ``base``, ``wide_ring`` (the second set of sizes that meets the contact time), or what is varied.
    value : float
        Of what is varied; NaN for the other two.
    history : SnareHistory
    """

    name: str
    value: float
    history: SnareHistory

    @property
    def final_offset(self) -> np.ndarray:
        """y and z of the pin's foot at the end [m], shape (2,)."""
        return self.history.target_position[-1, 1:]

    @property
    def peak_force(self) -> float:
        """Largest force at the end effector's root, averaged over 10 ms [N]."""
        return float(np.linalg.norm(self.history.mean_force, axis=1).max())


def capture(parameters: SnareParameters, target: Target, duration: float = DURATION) -> SnareHistory:
    """Simulate the test for a time [s], recorded every 10 ms."""
    return SnareModel(parameters, target).run(duration, every=0.01)


def main() -> int:
    """Run the study; leaves page and numbers in ``build/studies/ground-capture``."""
    begun = time.monotonic()
    cases = run_cases(_say)
    quantities = measure(cases)
    _say(table(quantities))
    found = sentence(cases)
    base = cases[0]
    scene = snare_scene(SceneData.of(base.history), SnareParameters())
    page = write_page(
        STUDY,
        "Suspended ground test of a snare (Li et al.)",
        found,
        quantities,
        sections(cases, SnareParameters().dimensions()),
        scene.html(start=base.history.first_contact or 0.0),
        "The three cables, the rings (grey; the one with the moving knots turns), the pin and its knob. Red marks are "
        "contacts. Drag to turn, scroll to come closer, right button to shift.",
    )
    write_result(STUDY, quantities, time.monotonic() - begun)
    _say(f"\n{found}\nReport: {page.resolve()}")
    return 0


def run_cases(say: Callable[[str], None]) -> list[GroundCase]:
    """All captures: the base case first, then the second set of sizes, then what is varied."""
    base, target = SnareParameters(), Target("spring")
    say("Capture of 10 s, base case ...")
    cases = [GroundCase("base", np.nan, capture(base, target))]
    say("  with the second set of sizes that meets the contact time ...")
    cases.append(GroundCase("wide_ring", np.nan, capture(WIDE_RING, target)))
    for name, values in SWEEPS.items():
        usual = target.mass if name == "mass" else getattr(base, name)
        for value in values:
            if value == usual:
                cases.append(GroundCase(name, value, cases[0].history))
                continue
            say(f"  with {name} {value:g} ...")
            if name == "mass":
                cases.append(GroundCase(name, value, capture(base, replace(target, mass=value))))
            else:
                cases.append(GroundCase(name, value, capture(base.with_values(**{name: value}), target)))
    return cases


def measure(cases: list[GroundCase]) -> list[Quantity]:
    """The base case beside the paper's numbers; intervals are ranges over all captures, not confidence."""
    base = cases[0]
    contacts = [_contact(c) for c in cases]
    offsets = np.array([c.final_offset for c in cases])
    peaks = [c.peak_force for c in cases]
    quantities = [
        Quantity("first_contact", "s", _contact(base), "calibrated", PAPER_CONTACT, min(contacts), max(contacts))
    ]
    for axis, name in enumerate(("final_radial_y", "final_radial_z")):
        low, high = float(offsets[:, axis].min()), float(offsets[:, axis].max())
        quantities.append(Quantity(name, "m", float(base.final_offset[axis]), "predicted", PAPER_OFFSET, low, high))
    quantities.append(Quantity("peak_force", "N", base.peak_force, "reference", None, min(peaks), max(peaks)))
    for name, unit, paper, attribute in (
        ("mean_spread", "m", PAPER_POSITION_ERROR, "target_position"),
        ("mean_force_spread", "N", PAPER_FORCE_ERROR, "mean_force"),
    ):
        middle = getattr(base.history, attribute)
        spread = np.max([np.mean(np.abs(getattr(c.history, attribute) - middle), axis=0) for c in cases], axis=0)
        quantities += [
            Quantity(f"{name}_{axis}", unit, float(ours), "reference", theirs)
            for axis, ours, theirs in zip("xyz", spread, paper, strict=True)
        ]
    return quantities


def sentence(cases: list[GroundCase]) -> str:
    """What the study found."""
    base, others = cases[0], _others(cases)
    y, z = 1e3 * base.final_offset
    inside = sum(bool(np.all(np.abs(c.final_offset) < PAPER_OFFSET)) for c in others)
    peaks = [c.peak_force for c in cases]
    return (
        f"Sized to touch the pin at {_contact(base):.2f} s (paper: 2.6 s), the snare brings it to {y:.1f} and {z:.1f} "
        f"mm off the axis in ten seconds (paper: both below 10 mm), and stays below in {inside} of {len(others)} "
        f"captures with other friction, damping, mass and sizes; the peak force ranges from {min(peaks):.0f} to "
        f"{max(peaks):.0f} N."
    )


def _others(cases: list[GroundCase]) -> list[GroundCase]:
    """All captures but the base case, which each sweep repeats."""
    return [c for c in cases if c.history is not cases[0].history]


def _contact(case: GroundCase) -> float:
    contact = case.history.first_contact
    return np.inf if contact is None else contact


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    sys.exit(status_of(main))
