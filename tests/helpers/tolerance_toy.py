"""A tolerance study whose outcomes are written down instead of simulated."""

from pathlib import Path

import numpy as np

from snarelab.tolerance.capture import Axis, Capture, Outcome
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import Study, Success

FILMED: list[float] = []


def outcome(y: float, z: float) -> Outcome:
    """Off the axis beyond 30 mm, escaped beyond 70 mm, never touched beyond 90 mm; it diverges beyond z = 80 mm."""
    if z > 0.08:
        return Outcome.failed("the step diverged")
    return Outcome(y < 0.07, y / 3, np.nan if y > 0.09 else 2.6, 5.0, 100.0)


def film(values) -> str:
    FILMED.append(values["radial_y"])
    return f"<p>{values['radial_y']}</p>"


def toy_study(folder: Path) -> Study:
    axes = tuple(Axis(n, "m", n, 0.0, -1.0, 1.0) for n in ("radial_y", "radial_z"))
    capture = Capture("toy", axes, lambda values: outcome(**values), film=film)
    ranges = {"radial_y": (0.0, 0.1), "radial_z": (-0.1, 0.1)}
    return Study(folder, "toy", capture, 1, "sobol", 8, 64, 0.05, ranges, {}, Success(0.010, 8e3), {}, 1)


def toy_results(folder: Path, study: Study) -> Results:
    """Forty cases over the ranges."""
    results = Results(folder, study)
    for number, point in enumerate(np.random.default_rng(3).random((40, 2))):
        values = study.values(study.scaled(point[None])[0])
        results.add("space", number, values, outcome(values["radial_y"], values["radial_z"]))
    return results
