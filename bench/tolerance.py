"""Tolerance studies: two workers against one, what captures and the engine cost, and adaptive cases against Sobol ones.

``python bench/tolerance.py [RESULT.json] [--cases N]``.

1. The ground captures of one Sobol study (N cases, the same ones), run to the end by one worker and by two on two
   cores, each warmed up first; by the clock, so the machine has to be quiet: its load before and after is printed.
   Beside it the same captures in one bare process and in two, without an engine: what the cores can give at all.
   Engine and bare take turns, twice; the medians count.
2. What a capture costs: the median processor time of several, in one process and one thread.
3. The engine's own time a case, over that of a ground capture: an adaptive study in five axes whose captures cost
   nothing. It holds scheduling, recording on disk, and the choice of the next cases.
4. Cases to the same width of the boundary, four times. The classifier is real but cheap: whether the pin, as it
   arrives, reaches through the open snare without touching, from the shapes of settled cables and rings. No physics
   moves in it. ``bench/tolerance_adaptive.py`` does it on captures.
"""

import argparse
import json
import multiprocessing
import os
import platform
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from dask.distributed import Client
from scipy.spatial.transform import Rotation
from scipy.stats import qmc

import snarelab
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.settled import settled
from snarelab.tolerance.boundary import Boundary, fit_boundary
from snarelab.tolerance.capture import Axis, Capture, Outcome, run_case
from snarelab.tolerance.enclosure import closed_loop, runs_through
from snarelab.tolerance.ground import CAPTURE
from snarelab.tolerance.results import Results
from snarelab.tolerance.run import local_cluster, run_study
from snarelab.tolerance.study import Study, load_study

SPEEDUP_GOAL, OVERHEAD_GOAL, SHARE_GOAL, HOURLY_GOAL = 1.8, 0.05, 0.25, 1200
WIDTH, SEEDS, MOST = 0.08, (1, 2, 3, 4), 160
GROUND = Path(snarelab.__file__).parent / "tolerance" / "ground.toml"
SNARE = SnareParameters()


def instant(values: Any) -> Outcome:
    """A capture that costs nothing, for what the engine costs; an ellipsoid, so that there is a boundary to find."""
    error = 0.010 * (
        (values["radial_y"] / 0.05) ** 2 + (values["radial_z"] / 0.04) ** 2 + (values["pitch"] / 0.08) ** 2
    )
    return Outcome(True, error, 2.6, 5.0, 100.0)


def clock(study: Study, jobs: int, warm: Any) -> float:
    """Time by the clock of a whole study, with that many workers that have run a case before [s]."""
    with tempfile.TemporaryDirectory() as folder, local_cluster(jobs) as cluster, Client(cluster) as client:
        client.run(run_case, study.capture, warm)
        address: Any = client.scheduler_info()["address"]
        begun = time.perf_counter()
        run_study(study, Results(Path(folder) / "out", study), scheduler=address)
        return time.perf_counter() - begun


def ready(barrier: Any, study: Study, warm: Any) -> None:
    """What a bare process does before the clock starts."""
    run_case(study.capture, warm)
    barrier.wait()


def bare(study: Study, jobs: int, warm: Any) -> float:
    """Time by the clock of the same captures in so many processes that only share out the cases [s]."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(jobs + 1)
    points = study.scaled(qmc.Sobol(len(study.ranges), rng=study.seed).random(study.cases))
    with context.Pool(jobs, ready, (barrier, study, warm)) as pool:
        barrier.wait()
        begun = time.perf_counter()
        pool.starmap(run_case, [(study.capture, study.values(point)) for point in points], chunksize=1)
        return time.perf_counter() - begun


def case_seconds(study: Study, cases: int) -> tuple[float, float]:
    """Median time of a capture over Sobol cases of the study, by the clock and by the processor [s]."""
    points = study.scaled(qmc.Sobol(len(study.ranges), rng=study.seed).random(8))[:cases]
    run_case(study.capture, study.values(points[0]))  # compiled, and read in, outside the timing
    spent = []
    for point in points:
        marks = time.perf_counter(), time.process_time()
        run_case(study.capture, study.values(point))
        spent.append((time.perf_counter() - marks[0], time.process_time() - marks[1]))
    clock, processor = np.median(spent, axis=0)
    return float(clock), float(processor)


def clearance(values: Any) -> Outcome:
    """How far the pin is from cables and rings as it arrives, given as a radial error: none of it, a miss."""
    turn = Rotation.from_euler("xyz", [0.0, values["pitch"], values["yaw"]]).as_matrix()
    foot, axis = np.array([0.2369, values["radial_y"], values["radial_z"]]), -turn[:, 0]
    loop = closed_loop(SHAPE, round(SNARE.ring_direction))
    fine = np.concatenate([loop + t * (np.roll(loop, -1, axis=0) - loop) for t in np.linspace(0, 1, 8, endpoint=False)])
    along = np.clip((fine - foot) @ axis, 0.0, SNARE.pin_length)
    apart = np.linalg.norm(fine - foot - along[:, None] * axis, axis=1).min()
    gap = (apart if runs_through(SHAPE, SHAPE, foot, axis, SNARE) else -apart) - SNARE.pin_radius - SNARE.cable_radius
    return Outcome(True, 0.010 * (1.0 - gap / SNARE.ring_radius), np.nan, 0.0, 0.0)


SHAPE = settled(SNARE, 10)[:, :, 0]
MISALIGNED = {
    "radial_y": (-0.15, 0.15),
    "radial_z": (-0.15, 0.15),
    "pitch": (-0.3, 0.3),
    "yaw": (-0.3, 0.3),
}


@dataclass(frozen=True)
class Sampled:
    """Cases that were run, the width of the boundary that they give, and the share of other points it has wrong."""

    cases: int
    width: float
    wrong: float

    def __str__(self) -> str:
        """In words."""
        return f"{self.cases} cases: {100 * self.width:.1f} % undecided, {100 * self.wrong:.1f} % wrong"


def compare(study: Study, most: int) -> tuple[Sampled, Sampled]:
    """Adaptive sampling to the width (or to so many cases), and Sobol cases by the share that is to be saved."""
    others = np.random.default_rng(5).random((4096, len(study.ranges)))

    def margins(unit: np.ndarray) -> np.ndarray:
        return np.array([study.success.margin(study.capture.run(study.values(p))) for p in study.scaled(unit)])

    truth = margins(others) > 0

    def fitted(unit: np.ndarray) -> tuple[Sampled, Boundary]:
        boundary = fit_boundary(unit, margins(unit), study.seed)
        wrong = np.mean((boundary.probability(others) > 0.5) != truth)
        return Sampled(len(unit), boundary.width(), float(wrong)), boundary

    plain = qmc.Sobol(len(study.ranges), rng=study.seed).random_base2(12)
    unit, was = plain[: study.batch], np.inf
    while True:
        found, boundary = fitted(unit)
        if max(found.width, was) <= study.width or len(unit) >= most:
            return found, fitted(plain[: round(len(unit) / SHARE_GOAL)])[0]
        was = found.width
        unit = np.vstack([unit, boundary.next_cases(study.batch, study.seed + len(unit))])


def main() -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Tolerance studies: workers, overhead, adaptive sampling")
    parser.add_argument("result", nargs="?", default="build/bench/tolerance.json", type=Path)
    parser.add_argument("--cases", type=int, default=32, help="ground captures for the workers")
    options = parser.parse_args()

    study = replace(load_study(GROUND), box={}, envelope=None)
    ground = replace(study, sampling="sobol", cases=options.cases, batch=options.cases)
    nominal = ground.values(ground.scaled(np.full((1, len(ground.ranges)), 0.5))[0])
    load = os.getloadavg()[0]
    turns = [[timed(ground, jobs, nominal) for timed in (clock, bare) for jobs in (1, 2)] for _ in range(2)]
    one, two, bare_one, bare_two = (float(t) for t in np.median(turns, axis=0))
    loads = load, os.getloadavg()[0]
    print(f"{options.cases} ground captures: one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} x "
          f"(goal {SPEEDUP_GOAL:g}); load {loads[0]:.1f} before, {loads[1]:.1f} after\n"
          f"the same in bare processes: one {bare_one:.1f} s, two {bare_two:.1f} s: {bare_one / bare_two:.2f} x",
          flush=True)  # fmt: skip

    seconds, processor = case_seconds(load_study(GROUND), min(options.cases, 8))
    inspection = case_seconds(load_study(GROUND.with_name("inspection.toml")), min(options.cases, 4))[1]
    for name, cost in (("ground", processor), ("inspection", inspection)):
        print(f"{name} capture: {cost:.2f} s of a core, {3600 / cost:.0f} an hour (goal on the ground {HOURLY_GOAL}); "
              f"10 000 take {cost / 0.36:.1f} core hours", flush=True)  # fmt: skip
    adaptive = replace(study, capture=Capture("instant", CAPTURE.axes, instant), width=1e-6)
    own = clock(adaptive, 1, nominal) / adaptive.cases
    print(f"the engine: {1e3 * own:.0f} ms a case, {100 * own / seconds:.1f} % of a ground capture's {seconds:.2f} s, "
          f"both by the clock (goal {100 * OVERHEAD_GOAL:g} %)", flush=True)  # fmt: skip

    axes = tuple(Axis(n, "m", "", 0.0, *limits) for n, limits in MISALIGNED.items())
    kinematic = replace(adaptive, capture=Capture("clearance", axes, clearance), ranges=MISALIGNED, width=WIDTH)
    pairs = []
    for seed in SEEDS:
        found, plain = compare(replace(kinematic, seed=seed), MOST)
        pairs.append((found, plain))
        print(f"boundary to {100 * WIDTH:g} %, seed {seed}: adaptive, {found}; Sobol, {plain}", flush=True)
    narrower = sum(found.width <= min(WIDTH, plain.width) for found, plain in pairs)
    print(f"adaptive is as narrow with {100 * SHARE_GOAL:g} % of the cases in {narrower} of {len(SEEDS)}")

    result = {
        "bench": "tolerance", "machine": platform.machine(), "cases": options.cases, "one_worker": one,
        "two_workers": two, "speedup": one / two, "goal_speedup": SPEEDUP_GOAL, "load": loads,
        "bare_speedup": bare_one / bare_two, "turns": turns,
        "ground_capture_cpu_seconds": processor,
        "inspection_capture_cpu_seconds": inspection,
        "engine_seconds_a_case": own, "overhead": own / seconds, "goal_overhead": OVERHEAD_GOAL, "width": WIDTH,
        "adaptive": [asdict(found) for found, _ in pairs], "sobol": [asdict(plain) for _, plain in pairs],
        "share_of_cases": SHARE_GOAL, "adaptive_as_narrow": narrower,
    }  # fmt: skip
    options.result.parent.mkdir(parents=True, exist_ok=True)
    options.result.write_text(json.dumps(result, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
