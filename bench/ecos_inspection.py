"""The inspection capture in Ecos: the arm's FMU in C and the snare's FMU with Python beside it, from one SSP file.

``python bench/ecos_inspection.py [RESULT.json]``. Exports both, writes the SSP file, runs 10.5 s in Ecos in a process
of its own, and holds the pin's place and the force against the orbit study's own co-simulation, as the study holds that
against one system. The bars are the coupling errors that the study states for this case, 0.7 µm and 0.02 % of the
force. Needs `ecospy`, `tbb` and `exudyn`. Exit status 1 where a bar is not met.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy.spatial.transform import Rotation

from bench.fmu_models import tool_environment
from bench.results import write_result
from snarelab.cosim.orbit_capture import (
    DURATION,
    MACRO_STEP,
    SNARE,
    JointResistance,
    OrbitCapture,
    capture_of,
    co_simulate,
)
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.setup import Setup
from snarelab.cosim.ssp_write import write_ssp
from snarelab.cosim.system import System
from snarelab.fmu.build import write_fmu
from snarelab.fmu.elements import station_arm
from snarelab.fmu.export import export
from snarelab.models.floating.space_arm import CAPTURE_POSE
from snarelab.studies.orbit.setting import END, radial_end, setting

POSITION_BAR, FORCE_BAR = 0.7e-6, 2e-4
EVERY, WINDOW = 5, 0.05  # steps from sample to sample; over which forces are averaged [s]
FRAME = [f"{kind}.{{}}.{a}" for kind, axes in (("pos", "xyz"), ("quat", "wxyz"), ("vel", "xyz"), ("omega", "xyz"))
         for a in axes]  # fmt: skip
SHOWN = [
    *(f"arm::pos.{body}.{a}" for body in ("tip", "mount") for a in "xyz"),
    *(f"arm::quat.tip.{a}" for a in "xyzw"),
    *(f"snare::impulse.effector.{a}" for a in "xyz"),
]


def write_system(folder: Path, version: int = 2, stiff: bool = True, values: Mapping[str, float] | None = None) -> Path:
    """Both FMUs and the SSP file, in a folder; returns the file. ``values`` adds to the parameters."""
    start = setting("inspection")
    write_fmu(station_arm(start.arm, stiff), folder / "arm.fmu", version)
    export("held_snare", version, folder / "snare.fmu")
    ports = (("tip", "effector"), ("mount", "pin"))
    wires = [(f"arm.{name.format(a)}", f"snare.{name.format(b)}") for a, b in ports for name in FRAME]
    wires += [
        (f"snare.held_{kind}.{b}.{x}", f"arm.{kind}.{a}.{x}")
        for a, b in ports
        for kind in ("force", "torque")
        for x in "xyz"
    ]
    given = {f"arm.start.q.joint{k}": float(q) for k, q in enumerate(CAPTURE_POSE, 1)}
    given |= {f"snare.{item.name}": float(item.value) for item in SNARE.dimensions()}
    participants = {"arm": Fmu(folder / "arm.fmu", "arm"), "snare": Fmu(folder / "snare.fmu", "snare")}
    driven = {target for _, target in wires}
    given |= {
        f"{name}.{v.name}": v.start
        for name, participant in participants.items()
        for v in participant.variables
        if v.causality == "input" and f"{name}.{v.name}" not in driven
    }
    given |= values or {}
    system = System(participants, wires, parameters=given, name="inspection")
    write_ssp(Setup(system, step=MACRO_STEP, stop=DURATION), folder / "inspection.ssp")
    for participant in participants.values():
        participant.close()
    return folder / "inspection.ssp"


def in_ecos(ssp: Path, step: float, steps: int, every: int) -> dict[str, np.ndarray]:
    """``SHOWN`` by name, and ``time`` [s], at each ``every`` steps; raises RuntimeError with what Ecos printed."""
    given = {"ssp": str(ssp), "step": step, "steps": steps, "every": every, "shown": SHOWN}
    command = [sys.executable, str(Path(__file__).resolve()), "--inside", json.dumps(given)]
    run = subprocess.run(command, capture_output=True, text=True, env=tool_environment(), check=False)
    if run.returncode:
        raise RuntimeError(run.stdout + run.stderr)
    rows = np.array(
        [[float.fromhex(x) for x in line.split()[1:]] for line in run.stdout.splitlines() if line[:2] == "@ "]
    )
    return dict(zip(["time", *SHOWN], rows.T, strict=True))


def _inside(given: dict[str, Any]) -> None:
    """In the process that has Ecos' library on its path: run, and print rows of hexadecimal numbers."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=given["ssp"], step_size=given["step"]) as simulation:
        simulation.init(parameter_set="initialValues")
        for k in range(given["steps"] // given["every"] + 1):
            if k:
                simulation.step(given["every"])
            row = [k * given["every"] * given["step"], *(simulation.get_real(name) for name in given["shown"])]
            print("@", *(float(x).hex() for x in row), flush=True)
        simulation.terminate()


def columns(table: dict[str, np.ndarray], stem: str, axes: str = "xyz") -> np.ndarray:
    """Columns ``stem.x`` and so on (n, k)."""
    return np.column_stack([table[f"{stem}.{a}"] for a in axes])


def relative(table: dict[str, np.ndarray]) -> np.ndarray:
    """Pin's foot in the end effector's frame (n, 3) [m]."""
    turn = Rotation.from_quat(columns(table, "arm::quat.tip", "wxyz"), scalar_first=True)
    return turn.inv().apply(columns(table, "arm::pos.mount") - columns(table, "arm::pos.tip"))


def mean_force(times: np.ndarray, impulse: np.ndarray) -> np.ndarray:
    """Mean force on the end effector in windows of 50 ms (k, 3) [N]."""
    ends = np.arange(0.0, times[-1] + 1e-9, WINDOW)
    at_ends = np.array([np.interp(ends, times, x) for x in impulse.T], float)
    return np.diff(at_ends, axis=1).T / WINDOW


def apart(table: dict[str, np.ndarray], study: OrbitCapture) -> tuple[float, float]:
    """Largest distance between the pin's places in the end effector's frame [m], and the forces' relative RMS error."""
    there = np.column_stack([np.interp(table["time"], study.times, x) for x in study.relative.T])
    ours = mean_force(table["time"], columns(table, "snare::impulse.effector"))
    theirs = mean_force(study.times, study.impulse)
    force = np.sqrt(np.sum((ours - theirs) ** 2) / np.sum(theirs**2))
    return float(np.linalg.norm(relative(table) - there, axis=1).max()), float(force)


def main() -> int:
    """Run, print, write; 1 where a bar is not met."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/ecos_inspection.json")
    with tempfile.TemporaryDirectory() as scratch:
        ssp = write_system(Path(scratch))
        began = time.monotonic()
        table = in_ecos(ssp, MACRO_STEP, round(DURATION / MACRO_STEP), EVERY)
        seconds = time.monotonic() - began
    study = capture_of(co_simulate(setting("inspection"), JointResistance()), "inspection")
    place, force = apart(table, study)
    ours, theirs = relative(table)[round(END / MACRO_STEP) // EVERY, 1:], radial_end(study)
    result = {
        "bench": "ecos_inspection",
        "final_radial": ours.tolist(),
        "final_radial_study": theirs.tolist(),
        "position_error": place,
        "force_error": force,
        "seconds": seconds,
        "bars": {"position_error": POSITION_BAR, "force_error": FORCE_BAR},
    }
    print(f"Ecos, {DURATION:g} s in steps of {1e3 * MACRO_STEP:g} ms: {seconds:.0f} s")
    for name, end in (("Ecos", ours), ("study", theirs)):
        print(f"{name:6s} the pin is {1e3 * end[0]:.4f} and {1e3 * end[1]:.4f} mm off the axis at {END:g} s")
    print(f"apart  {1e6 * place:.2f} um at most (bar {1e6 * POSITION_BAR:g})")
    print(f"force  {100 * force:.3f} % RMS over {1e3 * WINDOW:g} ms (bar {100 * FORCE_BAR:g})")
    write_result(path, result)
    return 0 if place <= POSITION_BAR and force <= FORCE_BAR else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        _inside(json.loads(sys.argv[2]))
    else:
        sys.exit(main())
