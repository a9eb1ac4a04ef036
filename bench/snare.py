"""A ten-second capture: our cables in Exudyn against rods in MuJoCo, with MuJoCo's own contact code, in one run.

``python bench/snare.py [RESULT.json] [--cases N]``. Both engines are given the same dimensions, the same shape of the
cables at rest and the same target. The base case measures CPU time: each engine at the setting that is used and at one
finer, whose distance is its error (largest distance of the pin's paths). With ``--cases N`` the base case and N
random ones (offset, tilt, mass, friction) are then compared between the engines: first contact and final offset.
"""

import argparse
import cProfile
import json
import os
import platform
import pstats
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray

from bench.mujoco_rods import capture
from snarelab.models.snare.model import SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled
from snarelab.models.snare.target import PAPER_POSITION, Target

Array = NDArray[np.float64]
DURATION, EVERY = 10.0, 0.01
REAL_TIME_GOAL, RATIO_GOAL = 0.3, 8.0
CONTACT_GOAL, OFFSET_GOAL = 0.010, 0.3e-3
RODS, RODS_FINE = (40, 5e-4), (40, 2e-4)
"""Segments of a cable, time step [s]."""


@dataclass(frozen=True)
class Run:
    """CPU time [s], first contact [s], and the path of the pin's foot every 10 ms, shape (n_times, 3) [m]."""

    seconds: float
    contact: float
    path: Array

    def off(self, other: "Run") -> float:
        """Largest distance to another run's path [m]."""
        return float(np.linalg.norm(self.path - other.path, axis=1).max())


@dataclass(frozen=True)
class Agreement:
    """Our first contact [s]; MuJoCo's minus ours [s]; distance of the final y, z [m]."""

    name: str
    first_contact: float
    contact: float
    offset: float


def cables(parameters: SnareParameters, target: Target, accuracy: str) -> Run:
    begun = time.process_time()
    history = SnareModel(parameters, target, accuracy).run(DURATION, EVERY)  # pyright: ignore[reportArgumentType]
    seconds = time.process_time() - begun
    return Run(seconds, history.first_contact or np.nan, history.target_position[1:])


def rods(parameters: SnareParameters, target: Target, setting: tuple[int, float]) -> Run:
    n_segments, step = setting
    run = capture(parameters, target, settled(parameters, n_segments)[:, :, 0], DURATION, step)
    every = round(EVERY / step)
    return Run(run.seconds, run.first_contact, run.position[every - 1 :: every])


def profile(parameters: SnareParameters, target: Target) -> dict[str, float]:
    """Shares of the CPU time: our compiled contact, our bookkeeping, and Exudyn (elements and solver)."""
    model = SnareModel(parameters, target)
    model.run(0.1)
    profiler = cProfile.Profile(time.process_time)
    profiler.runcall(model.run, DURATION, EVERY)
    spent = pstats.Stats(profiler).stats  # pyright: ignore[reportAttributeAccessIssue]
    total = sum(own for _, _, own, _, _ in spent.values())

    def share(*names: str) -> float:
        return sum(s[3] for (file, _, name), s in spent.items() if "models/snare" in file and name in names) / total

    contact, upkeep = share("forces", "jacobian"), share("residual", "derivative", "after_step", "record", "save")
    return {"contact": contact, "bookkeeping": upkeep, "elements_and_solver": 1 - contact - upkeep}


def random_case(rng: np.random.Generator) -> tuple[SnareParameters, Target]:
    """Offset, tilt, mass and friction drawn around the ground test."""
    radius, azimuth = rng.uniform(0.03, 0.09), rng.uniform(-np.pi, np.pi)
    position = (PAPER_POSITION[0], radius * np.cos(azimuth), radius * np.sin(azimuth))
    tilt = np.array([0.0, *rng.uniform(-0.02, 0.02, 2)])
    orientation = [float(np.sqrt(1 - tilt @ tilt)), *tilt.tolist()]
    target = Target("spring", position, orientation, mass=float(rng.uniform(10, 60)))
    return SnareParameters(friction=float(rng.uniform(0.0, 0.3))), target


def main() -> int:
    """Measure, print, write; 1 where the engines disagree beyond the bars."""
    parser = argparse.ArgumentParser(description="Captures: ours against MuJoCo rods")
    parser.add_argument("result", nargs="?", default="build/bench/snare.json", type=Path)
    parser.add_argument("--cases", type=int, default=0, help="random cases compared between the engines")
    options = parser.parse_args()
    base = SnareParameters(), Target("spring")
    SnareModel(*base).run(0.1)  # compiled, and read in, outside the timing

    ours, fine = cables(*base, "default"), cables(*base, "fine")
    theirs, theirs_fine = rods(*base, RODS), rods(*base, RODS_FINE)
    rows = [
        {"name": name, "cpu_seconds": run.seconds, "first_contact": run.contact, "error": error, "final": final}
        for name, run, error in (
            ("ours, default", ours, ours.off(fine)),
            ("ours, fine", fine, None),
            (f"MuJoCo, {RODS[0]} rods, {1e3 * RODS[1]:g} ms", theirs, theirs.off(theirs_fine)),
            (f"MuJoCo, {RODS_FINE[0]} rods, {1e3 * RODS_FINE[1]:g} ms", theirs_fine, None),
        )
        for final in [run.path[-1].tolist()]
    ]
    print(f"Capture of {DURATION:g} s, base case")
    print(f"{'':28}{'CPU s':>8}{'x ours':>8}{'contact s':>11}{'final y, z mm':>16}{'error mm':>10}")
    for row in rows:
        y, z = 1e3 * np.array(row["final"][1:])
        error = "" if row["error"] is None else f"{1e3 * row['error']:.3f}"
        print(
            f"{row['name']:28}{row['cpu_seconds']:8.2f}{row['cpu_seconds'] / ours.seconds:8.1f}"
            f"{row['first_contact']:11.3f}{y:9.2f},{z:6.2f}{error:>10}"
        )
    real_time, ratio = ours.seconds / DURATION, theirs.seconds / ours.seconds
    print(f"ours takes {real_time:.2f} x real time (goal {REAL_TIME_GOAL:g})")
    print(f"MuJoCo takes {ratio:.1f} x the time of ours (goal {RATIO_GOAL:g})", flush=True)
    shares = profile(*base)
    print("of ours: " + ", ".join(f"{name.replace('_', ' ')} {100 * share:.0f} %" for name, share in shares.items()))

    rng = np.random.default_rng(3)
    cases = [agreement("base", fine, theirs_fine)]
    for number in range(options.cases):
        drawn = random_case(rng)
        cases.append(agreement(f"random {number + 1}", cables(*drawn, "default"), rods(*drawn, RODS)))
    agreed = all(abs(c.contact) <= CONTACT_GOAL and c.offset <= OFFSET_GOAL for c in cases)

    result = {
        "bench": "snare", "machine": platform.machine(), "duration": DURATION, "real_time_factor": real_time,
        "goal_real_time_factor": REAL_TIME_GOAL, "times_ours": ratio, "goal_times_ours": RATIO_GOAL,
        "engines": rows, "shares": shares, "cases": [asdict(c) for c in cases],
        "goal_contact": CONTACT_GOAL, "goal_offset": OFFSET_GOAL,
    }  # fmt: skip
    options.result.parent.mkdir(parents=True, exist_ok=True)
    options.result.write_text(json.dumps(result, indent=2) + "\n")
    if not agreed:
        print(f"the engines disagree by over {CONTACT_GOAL:g} s or {OFFSET_GOAL:g} m", file=sys.stderr)
        return 1
    return 0


def agreement(name: str, ours: Run, theirs: Run) -> Agreement:
    apart = float(np.linalg.norm((theirs.path - ours.path)[-1, 1:]))
    case = Agreement(name, ours.contact, theirs.contact - ours.contact, apart)
    print(
        f"  {name:12}first contact {ours.contact:.3f} s, MuJoCo {1e3 * case.contact:+6.1f} ms; "
        f"final offset {1e3 * apart:.3f} mm apart",
        flush=True,
    )
    return case


if __name__ == "__main__":
    sys.exit(main())
