"""Orders of the holds on a two-mass oscillator made of FMUs, and step control's error over its tolerance.

``python bench/cosim_orders.py docs [RESULT.json]`` draws ``cosimulation-fmu-orders.svg`` there. The oscillator is that
of `bench/cosim_accuracy.py`, its halves in C (`bench/oscillator_fmu.c`), both masses moving at the start: one that is
let go at rest has no slopes there, and would hide what the start costs. Ten seconds, against the matrix exponential.
FMI 2.0 takes first derivatives of inputs; FMI 3.0 has held inputs only. Errors are the largest of a position. Step
control has no constant hold, whose steps would be as small as its tolerance.
"""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import sys
import tempfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal

sys.path.append(str(Path(__file__).resolve().parents[1]))

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter
from scipy.linalg import expm

from bench.cosim_accuracy import CONNECTIONS
from bench.oscillator_fmu import build
from bench.results import write_result
from snarelab.cosim.master import HoldName, Master, Scheme
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import System
from snarelab.report.drawing import drawing, svg

HOLDS: tuple[HoldName, ...] = ("constant", "linear", "quadratic")
STEPS = (0.04, 0.02, 0.01, 0.005)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
SECONDS = 10.0
MOVING = {"left.position": 1.0, "left.speed": 0.5, "right.position": -0.4, "right.speed": -1.5}
_COLOURS = ("#000000", "#0072B2", "#D55E00")  # Okabe & Ito (2008)
Files = Mapping[str, Path]


def exact(times: np.ndarray) -> np.ndarray:
    """Positions of both masses [m], (n_samples, 2)."""
    rates = np.array([[0, 1, 0, 0], [-13, 0, 3, 0], [0, 0, 0, 1], [3, 0, -13, 0]], dtype=float)
    values, vectors = np.linalg.eig(rates)
    start = np.linalg.solve(vectors, [MOVING[f"{s}.{k}"] for s in ("left", "right") for k in ("position", "speed")])
    states = (np.exp(np.outer(times, values)) * start) @ vectors.T
    assert np.allclose(states[-1], expm(rates * times[-1]) @ states[0])
    return states.real[:, [0, 2]]


def halves(folder: Path, fmi: Literal[2, 3]) -> dict[str, Path]:
    """The two FMUs, built."""
    return {side: build(folder, side, fmi) for side in ("left", "right")}


def error(
    files: Files,
    step: float,
    hold: HoldName,
    scheme: Scheme = "jacobi",
    iterate: bool = False,
    control: StepControl | None = None,
) -> float:
    """Largest position error [m] of either mass."""
    system = System({side: Fmu(file) for side, file in files.items()}, CONNECTIONS, parameters=MOVING)
    with Master(system, step, hold=hold, scheme=scheme, iterate=iterate, control=control) as master:
        found = master.run(SECONDS).recording
    positions = np.column_stack([found[f"{side}.x [m]"].to_numpy() for side in files])
    return float(np.abs(positions - exact(found["time"].to_numpy())).max())


def slopes(x: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Observed orders between neighbours."""
    pairs = zip(pairwise(x), pairwise(errors), strict=True)
    return [float(np.log(e1 / e2) / np.log(h1 / h2)) for (h1, h2), (e1, e2) in pairs]


def measured(folder: Path) -> dict[str, dict[str, list[float]]]:
    """Errors by panel and hold."""
    two, three = halves(folder, 2), halves(folder, 3)
    return {
        "FMI 2.0, slopes": {hold: [error(two, h, hold) for h in STEPS] for hold in HOLDS},
        "FMI 3.0, held": {hold: [error(three, h, hold) for h in STEPS] for hold in HOLDS},
        "step control": {
            hold: [error(two, 1e-3, hold, control=StepControl(tolerance)) for tolerance in TOLERANCES]
            for hold in HOLDS[1:]
        },
    }


def figure(found: Mapping[str, Mapping[str, Sequence[float]]]) -> bytes:
    """All panels as SVG."""
    with drawing():
        drawn, axes = plt.subplots(1, 3, figsize=(8.4, 3.2), sharey=True, layout="constrained")
        for panel, (title, curves) in zip(axes, found.items(), strict=True):
            x = TOLERANCES if title == "step control" else STEPS
            for (hold, errors), colour in ((c, _COLOURS[HOLDS.index(c[0])]) for c in curves.items()):
                label = f"{hold}, {'slope' if x is TOLERANCES else 'order'} {slopes(x, errors)[-1]:.1f}"
                panel.loglog(x, errors, color=colour, marker="o", markersize=3, label=label)
            panel.set(title=title, xlabel="tolerance" if x is TOLERANCES else "macro step [s]")
            panel.legend(loc="lower right", fontsize=7)
            _plain_ticks(panel, x)
        axes[0].set_ylabel("largest position error [m]")
        picture = svg(drawn)
        plt.close(drawn)
    return picture


def _plain_ticks(panel: Axes, at: Sequence[float]) -> None:
    panel.xaxis.set_major_locator(FixedLocator(list(at)))
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def main() -> None:
    """Measure, print, draw and write."""
    with tempfile.TemporaryDirectory() as scratch:
        found = measured(Path(scratch))
    orders = {}
    for title, curves in found.items():
        x = TOLERANCES if title == "step control" else STEPS
        orders[title] = {hold: slopes(x, errors) for hold, errors in curves.items()}
        for hold, errors in curves.items():
            shown = "  ".join(f"{e:8.1e}" for e in errors), "  ".join(f"{o:4.2f}" for o in orders[title][hold])
            print(f"{title:16} {hold:10} errors [m] {shown[0]}   orders {shown[1]}")
    (Path(sys.argv[1]) / "cosimulation-fmu-orders.svg").write_bytes(figure(found))
    result = {"bench": "cosim_orders", "steps": STEPS, "tolerances": TOLERANCES, "errors": found, "orders": orders}
    write_result(Path(sys.argv[2] if len(sys.argv) > 2 else "build/bench/cosim_orders.json"), result)


if __name__ == "__main__":
    main()
