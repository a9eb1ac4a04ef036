"""Cases to the same boundary of success, chosen where it is in doubt or spread evenly: on ground captures themselves.

``python bench/tolerance_adaptive.py [FOLDER] [--width 0.08] [--seeds 1]``. It takes a quarter of an hour of a
core; killed, it goes on where it was, as each capture is kept in FOLDER.

The pin's two offsets vary over 40 mm either way, everything else is at nominal. A study chooses its cases until the
boundary is as narrow as wanted, twice running. Sobol cases, four times as many at most, are run until the same rule,
applied after each batch, is met. How good the boundary of the chosen cases is shows in the share of the Sobol captures,
which it has not seen, on its wrong side.
"""

import argparse
import json
import os
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import numpy as np

import snarelab
from snarelab.files import written_whole
from snarelab.tolerance.boundary import UNDECIDED
from snarelab.tolerance.capture import run_case
from snarelab.tolerance.pictures import probability_maps
from snarelab.tolerance.results import Results
from snarelab.tolerance.run import sobol_points, space_boundary
from snarelab.tolerance.study import Study, load_study
from snarelab.tolerance.summary import to_unit

GROUND = Path(snarelab.__file__).parent / "tolerance" / "ground.toml"
RANGES = {"radial_y": (-0.04, 0.04), "radial_z": (-0.04, 0.04)}
BATCH, MOST, GOAL = 8, 128, 0.25


@dataclass(frozen=True)
class Narrowed:
    """How the boundary narrowed.

    Parameters
    ----------
    cases : list of int
        After each batch.
    width : list of float
        Undecided share of the range there.
    reached : int or None
        Cases at which the width was met twice running.
    """

    cases: list[int]
    width: list[float]
    reached: int | None

    def __str__(self) -> str:
        """In words, every fourth batch."""
        curve = [
            f"{100 * w:.1f} % with {n}" for n, w in zip(self.cases, self.width, strict=True) if n % (4 * BATCH) == 0
        ]
        met = f"met with {self.reached}" if self.reached else f"not met with {self.cases[-1]}"
        return f"{', '.join(curve)}; {met}"


def narrowed(study: Study, results: Results) -> Narrowed:
    """Run a study's cases batch by batch until the boundary is narrow twice running, or the cases are used up."""
    points = study.scaled(sobol_points(study, BATCH if study.sampling == "adaptive" else study.cases))
    cases, width = [], []
    while len(cases) * BATCH < study.cases:
        first = len(cases) * BATCH
        for number in range(first, first + BATCH):
            if not results.done("space", number):
                values = study.values(points[number])
                results.add("space", number, values, run_case(study.capture, values))
        boundary = space_boundary(study, results, first + BATCH)
        cases.append(first + BATCH)
        width.append(boundary.width())
        print(f"  {results.folder.name}, {cases[-1]} cases: {100 * width[-1]:.1f} % undecided", flush=True)
        if max(width[-2:]) <= study.width and len(width) > 1:
            return Narrowed(cases, width, cases[-1])
        if study.sampling == "adaptive":
            points = np.vstack([points, study.scaled(boundary.next_cases(BATCH, study.seed + cases[-1]))])
    return Narrowed(cases, width, None)


def main() -> int:
    """Run, compare, write."""
    parser = argparse.ArgumentParser(description="Adaptive against Sobol cases on ground captures")
    parser.add_argument("folder", nargs="?", default="build/bench/tolerance_adaptive", type=Path)
    parser.add_argument("--width", type=float, default=0.08, help="undecided share of the range that is wanted")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    options = parser.parse_args()

    options.folder.mkdir(parents=True, exist_ok=True)
    found = [compare(options.folder, seed, options.width) for seed in options.seeds]
    result = {"bench": "tolerance_adaptive", "ranges": RANGES, "wanted": options.width, "goal": GOAL, "seeds": found}
    with written_whole(options.folder / "result.json", "run again") as part:
        part.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    return 0


def compare(folder: Path, seed: int, width: float) -> dict[str, object]:
    """Both samplings with one seed, at most four times as many Sobol cases as were chosen."""
    adaptive = replace(load_study(GROUND), ranges=RANGES, box={}, seed=seed, width=width, batch=BATCH, cases=MOST)
    chosen = Results(folder / f"adaptive-{seed}", adaptive)
    ours = narrowed(adaptive, chosen)
    spread = replace(adaptive, sampling="sobol", cases=round(ours.cases[-1] / GOAL))
    plain = Results(folder / f"sobol-{seed}", spread)
    theirs = narrowed(spread, plain)
    others = plain.table("space").iloc[BATCH : theirs.cases[-1]]  # both sets begin with the same batch
    p = space_boundary(adaptive, chosen, ours.cases[-1]).probability(
        to_unit(adaptive, others[list(RANGES)].to_numpy(float))
    )
    wrong = (p > 0.5) != (others["margin"].to_numpy(float) > 0)
    decided = (p < UNDECIDED[0]) | (p > UNDECIDED[1])
    print(f"seed {seed}, undecided to {100 * width:g} %\n  chosen: {ours}\n  Sobol: {theirs}")
    print(f"  of {len(others)} Sobol captures the chosen ones' boundary has {np.sum(wrong)} on its wrong side, "
          f"{np.sum(wrong & decided)} of them where it is sure")  # fmt: skip
    if ours.reached and theirs.reached:
        print(f"  {ours.reached / theirs.reached:.2f} of the cases (goal {GOAL:g})", flush=True)
    for name, side, study, results in (("adaptive", ours, adaptive, chosen), ("sobol", theirs, spread, plain)):
        run = results.table("space").iloc[: side.cases[-1]]
        picture = probability_maps(study, space_boundary(study, results, side.cases[-1]), run)
        (folder / f"{name}-{seed}.svg").write_bytes(picture)
    return {
        "seed": seed,
        "adaptive": asdict(ours),
        "sobol": asdict(theirs),
        "sobol_captures": len(others),
        "wrong": int(np.sum(wrong)),
        "wrong_where_sure": int(np.sum(wrong & decided)),
    }


if __name__ == "__main__":
    sys.exit(main())
