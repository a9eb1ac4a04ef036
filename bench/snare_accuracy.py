"""Accuracy of the snare's two settings on random captures, against a reference whose own convergence is shown.

``python bench/snare_accuracy.py [--cases 30] [--processes 2] [--result RESULT.json] [--plot PLOT.svg]``

Cases are drawn evenly: the pin's foot 20 to 88 mm off the axis in any direction, up to 2° about each axis, mass 10 to
200 kg (in its logarithm), friction 0 to 0.3; a pendulum of 2 m, a capture of 10 s. Errors of a run: the largest
distance of the pin's foot from the reference's, and the root mean square of the difference in force on the end
effector, averaged over 50 ms, as a share of the force's own. The reference has 28 elements and steps of 0.25 ms
in contact; on the first cases a finer one shows how far it can be trusted. One case flatters coarse settings: the worst
of all counts.
"""

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import numpy as np
from scipy.spatial.transform import Rotation

from snarelab.models.snare.model import ACCURACIES, Accuracy, SnareModel
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

SEED = 3
REFERENCE = Accuracy(2.5e-4, 28, 1e-4)
FINER = Accuracy(1.25e-4, 40, 5e-5)
N_FINER = 2
BARS = {"default": {"position_mm": 0.05, "force_median": 0.5, "force_worst": 3.0}, "fine": {"force_worst": 1.0}}
STEPS = (8e-3, 4e-3, 2e-3, 1e-3)
ELEMENTS = (4, 5, 6, 8)


@dataclass(frozen=True)
class Case:
    """One capture: dimensions and target."""

    parameters: SnareParameters
    target: Target


def cases(number: int) -> list[Case]:
    """The first so many of the random captures."""
    rng = np.random.default_rng(SEED)
    drawn = []
    for _ in range(number):
        radius, azimuth = rng.uniform(0.02, 0.088), rng.uniform(0, 2 * np.pi)
        tilt = Rotation.from_rotvec(np.deg2rad(rng.uniform(-2, 2, 3)))
        mass, friction = 10 ** rng.uniform(1, 2.3), rng.uniform(0, 0.3)
        position = (0.2369, radius * np.cos(azimuth), radius * np.sin(azimuth))
        orientation = tilt.as_quat(canonical=True, scalar_first=True).tolist()
        target = Target("pendulum", position=position, orientation=orientation, mass=mass)
        drawn.append(Case(SnareParameters(friction=friction), target))
    return drawn


def capture(case: Case, accuracy: Accuracy, duration: float = 10.0) -> tuple[np.ndarray, np.ndarray, float]:
    """Positions [m] and mean forces [N] every 50 ms, and CPU time [s]."""
    started = time.process_time()
    history = SnareModel(case.parameters, case.target, accuracy).run(duration, every=0.05)
    return history.target_position, history.mean_force, time.process_time() - started


def errors(
    run: tuple[np.ndarray, np.ndarray, float], reference: tuple[np.ndarray, np.ndarray, float]
) -> tuple[float, float]:
    """Largest position error [mm] and force error [%]."""
    position = np.max(np.linalg.norm(run[0] - reference[0], axis=1))
    force = np.linalg.norm(run[1] - reference[1]) / np.linalg.norm(reference[1])
    return float(position * 1e3), float(force * 100)


def measure(task: tuple[int, Case]) -> dict[str, tuple[float, ...]]:
    """Errors and CPU times of every setting on one case."""
    index, case = task
    reference = capture(case, REFERENCE)
    result: dict[str, tuple[float, ...]] = {"reference": (0.0, 0.0, reference[2])}
    for name, accuracy in ACCURACIES.items():
        run = capture(case, accuracy)
        result[name] = (*errors(run, reference), run[2])
    if index < N_FINER:
        finer = capture(case, FINER)
        result["reference against finer"] = (*errors(reference, finer), finer[2])
    return result


def orders() -> dict[str, list[tuple[float, float]]]:
    """Error against step and against element length, up to 4 s of the base case [mm], each with the other one fine."""
    case = Case(SnareParameters(), Target("pendulum"))

    def error(accuracy: Accuracy, reference: tuple[np.ndarray, np.ndarray, float]) -> float:
        return errors(capture(case, accuracy, 4.0), reference)[0]

    short = capture(case, Accuracy(1.25e-4, 10, 1e-4), 4.0)
    many = capture(case, Accuracy(1.25e-4, 28, 1e-4), 4.0)
    return {
        "step [s]": [(step, error(Accuracy(step, 10, 1e-4), short)) for step in STEPS],
        "element/cable": [(1 / number, error(Accuracy(1.25e-4, number, 1e-4), many)) for number in ELEMENTS],
    }


def slope(points: list[tuple[float, float]]) -> float:
    """Observed order: slope of log error over log size."""
    sizes, values = np.log(np.array(points)).T
    return float(np.polyfit(sizes, values, 1)[0])


def plot(convergence: dict[str, list[tuple[float, float]]], path: Path) -> None:
    """Draw errors over sizes, with the observed orders."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    for axes, (name, points) in zip(figure.subplots(1, 2), convergence.items(), strict=True):
        axes.loglog(*np.array(points).T, "o-", color="#0072B2")
        axes.set(xlabel=name, ylabel="largest position error [mm]", title=f"observed order {slope(points):.1f}")
        axes.grid(which="both", color="#E3E7EA")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    """Run, print, and write what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--result", type=Path)
    parser.add_argument("--plot", type=Path, default=Path("build/bench/snare_convergence.svg"))
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        results = list(pool.map(measure, enumerate(cases(given.cases))))
    summary = {}
    print(f"{given.cases} random captures of 10 s\n")
    print(f"{'setting':26}{'position mm: median, worst':>28}{'force %: median, worst':>26}{'CPU s: median':>16}")
    for name in ("default", "fine", "reference against finer"):
        table = np.array([r[name] for r in results if name in r])
        position, force, seconds = table.T
        row = {
            "position_mm": position.max(),
            "force_median": np.median(force),
            "force_worst": force.max(),
            "cpu_median": np.median(seconds),
        }
        summary[name] = {key: float(value) for key, value in row.items()} | {"cases": len(table)}
        print(
            f"{name:26}{np.median(position):18.4f}{position.max():10.4f}"
            f"{np.median(force):17.2f}{force.max():9.2f}{np.median(seconds):16.2f}"
        )
    for name, bars in BARS.items():
        for key, bar in bars.items():
            held = "held" if summary[name][key] <= bar else "NOT held"
            print(f"{name} {key}: {summary[name][key]:.3g}, bar {bar:g}: {held}")
    convergence = orders()
    for name, points in convergence.items():
        listed = ", ".join(f"{size:.3g}: {value:.2g}" for size, value in points)
        print(f"order by {name}: {slope(points):.1f} ({listed} mm)")
    plot(convergence, given.plot)
    if given.result:
        summary["orders"] = {name: slope(points) for name, points in convergence.items()}
        given.result.parent.mkdir(parents=True, exist_ok=True)
        given.result.write_text(json.dumps(summary, indent=1))


if __name__ == "__main__":
    main()
