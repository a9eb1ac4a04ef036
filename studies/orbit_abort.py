"""Abort: a pin outside the envelope, let go by the control program with no contact left; see `orbit`."""

import sys
import time

from scipy.spatial.transform import Rotation

from ..cosim.docked import CABLE_STRENGTH, docked_of, mean_wrist, momentum_drift
from ..cosim.orbit_capture import SNARE, arrival
from ..cosim.whole_capture import co_simulate_whole
from ..exit_status import status_of
from ..models.docking.parameters import DockingParameters
from ..models.inertia import Array
from .orbit.docked_figures import pictures
from .orbit.scene import add_phases, orbit_scene
from .orbit.setting import column
from .outcome import Quantity, table, write_result
from .page import Section, write_page

FOOT, TURN = (0.30, 0.05, 0.03), (0.0, 0.035, 0.035)
"""The pin's foot in the end effector's frame [m] and its turns [rad], chosen: its knob alone reaches the cables."""


def main() -> int:
    """Run the study; leaves page and numbers in ``build/studies/orbit-abort``."""
    begun = time.monotonic()
    start = arrival("hover", FOOT, Rotation.from_euler("xyz", TURN))
    print("A pin outside the envelope, on a target of 10 t that floats ...", flush=True)
    frames: list[tuple[float, Array]] = []
    whole = co_simulate_whole(start, frames=frames)
    d = docked_of(whole)
    recording = whole.run.recording
    touching = column(recording, "snare.touching") + column(recording, "effector.touching")
    free = d.times[-1] - max(d.times[touching > 0], default=0.0)
    began = [begin for state, begin, _ in whole.phases if state in ("UNLOAD", "OPEN")]
    quantities = [
        Quantity("aborted", "1", float(whole.final == "ABORTED" and not whole.fault), "reference"),
        Quantity("abort_began", "s", began[0] if began else "never", "reference"),
        Quantity("free_of_contact", "s", float(free), "reference"),
        Quantity("peak_wrench_force", "N", float(mean_wrist(d)[1].max()), "reference"),
        Quantity("peak_cable_force", "N", float(d.tension.max()), "reference"),
        Quantity("momentum_drift", "1", momentum_drift(d), "reference"),
    ]
    print(table(quantities))
    path = " → ".join(state for state, _, _ in whole.phases)
    good = whole.final == "ABORTED" and free >= 1.0 and d.tension.max() < CABLE_STRENGTH
    found = (
        f"The program goes {path} and ends {'free of contact' if good else 'badly'}, "
        f"{free:.1f} s after the last touch; no cable bears more than {d.tension.max():.0f} N."
    )
    scene = orbit_scene(start, d.capture, SNARE, frames)
    add_phases(scene, d)
    report = write_page(
        "orbit-abort",
        "A pin outside the envelope: the way out",
        found,
        quantities,
        [
            Section(
                "What the program does",
                ["Transitions of the control program:", *(str(event) for event in whole.run.log)],
                pictures(d, DockingParameters()),
            )
        ],
        scene.html(),
        "Snare, pin and target; the ball above the snare shows the program's state, red on the way out.",
    )
    write_result("orbit-abort", quantities, time.monotonic() - begun, {"found": found, "path": path})
    print(f"\n{found}\nReport: {report.resolve()}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(status_of(main))
