"""Orders of the holds on a two-mass oscillator made of FMUs, and step control's error over its tolerance.

``python bench/cosim_orders.py [docs] [RESULT.json]`` draws ``cosimulation-fmu-orders.svg`` there. The oscillator is
that of `bench/two_masses.py`, its halves in C (`bench/oscillator_fmu.c`), both masses moving at the start: one that
is let go at rest has no slopes there, and would hide what the start costs. Ten seconds. FMI 2.0 takes first
derivatives of inputs; FMI 3.0 has no such call, and under the quadratic hold is given another value for the second half
of a step. Step control has no constant hold, whose steps would be as small as its tolerance.
"""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

sys.path.append(str(Path(__file__).resolve().parents[1]))

from bench.oscillator_fmu import build
from bench.results import write_result
from bench.two_masses import CONNECTIONS, SECONDS, error_figure, largest_error, slopes
from snarelab.cosim.master import HoldName, Master, Scheme
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.step_control import StepControl
from snarelab.cosim.system import System

HOLDS: tuple[HoldName, ...] = ("constant", "linear", "quadratic")
STEPS = (0.04, 0.02, 0.01, 0.005)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
MOVING = {"left.position": 1.0, "left.speed": 0.5, "right.position": -0.4, "right.speed": -1.5}
CONTROL = "step control, FMI "
Files = Mapping[str, Path]


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
        return largest_error(master.run(SECONDS).recording, tuple(MOVING.values()))


def measured(folder: Path) -> dict[str, dict[HoldName, list[float]]]:
    """Errors by panel and hold."""
    found: dict[str, dict[HoldName, list[float]]] = {}
    for fmi in (2, 3):
        files = halves(folder, fmi)
        found[f"FMI {fmi}.0"] = {hold: [error(files, h, hold) for h in STEPS] for hold in HOLDS}
        found[f"{CONTROL}{fmi}.0"] = {
            hold: [error(files, 1e-3, hold, control=StepControl(tolerance)) for tolerance in TOLERANCES]
            for hold in HOLDS[1:]
        }
    return dict(sorted(found.items()))


def along(title: str) -> tuple[str, Sequence[float]]:
    """What lies along a panel's x."""
    return ("tolerance", TOLERANCES) if title.startswith(CONTROL) else ("macro step [s]", STEPS)


def main() -> None:
    """Measure, print, draw and write."""
    with tempfile.TemporaryDirectory() as scratch:
        found = measured(Path(scratch))
    orders = {t: {hold: slopes(along(t)[1], errors) for hold, errors in c.items()} for t, c in found.items()}
    for title, curves in found.items():
        for hold, errors in curves.items():
            shown = "  ".join(f"{e:8.1e}" for e in errors), "  ".join(f"{o:4.2f}" for o in orders[title][hold])
            print(f"{title:22} {hold:10} errors [m] {shown[0]}   orders {shown[1]}")
    picture = error_figure([(title, *along(title), curves) for title, curves in found.items()], "slope")
    (Path(sys.argv[1] if len(sys.argv) > 1 else "docs") / "cosimulation-fmu-orders.svg").write_bytes(picture)
    result = {"bench": "cosim_orders", "steps": STEPS, "tolerances": TOLERANCES, "errors": found, "orders": orders}
    write_result(Path(sys.argv[2] if len(sys.argv) > 2 else "build/bench/cosim_orders.json"), result)


if __name__ == "__main__":
    main()
