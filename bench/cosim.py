"""Overhead of co-simulation masters: 100 000 macro steps of the same two small FMUs, side by side.

``python bench/cosim.py [RESULT.json]``. The FMUs are the halves of the coupled oscillators (`bench/oscillator_fmu.c`,
FMI 2.0), whose own work is a fraction of a microsecond. Masters take turns in one process; each turn starts from fresh
instances. Ours is given as it is used, with every output recorded at every step; also its loop in Python, which systems
take that are not all FMUs. FMPy is its own calls in a loop; libcosim and Ecos step by themselves and record nothing.
Both the clock's time and the process's own are written, as other work on the machine stretches the first, and masters
with threads of their own spread the second. Errors are the largest of a position over 10 s at 1 ms, against the exact
solution. libcosim and Ecos are left out, by name, where they cannot be loaded.
"""

import ctypes
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
sys.path.append(str(Path(__file__).resolve().parents[1]))

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from bench.oscillator_fmu import build
from bench.results import write_result
from bench.two_masses import CONNECTIONS, exact
from snarelab.cosim.master import Master
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.setup import Setup
from snarelab.cosim.ssp_write import write_ssp
from snarelab.cosim.system import System

N_STEPS, STEP, REPETITIONS, GOAL = 100_000, 1e-3, 5, 8.0
FORCE_IN, X_IN, V_IN, X, V, FORCE = 11, 9, 10, 12, 13, 14  # value references
Turn = tuple[Callable[[int], Any], Callable[[], tuple[float, float]], Callable[[], Any]]
"""Steps n times; shows both positions; ends."""


def ours(folder: Path, compiled: bool = True) -> Turn:
    """snarelab's master with its default hold."""
    halves = {side: Fmu(folder / f"{side}2.fmu") for side in ("left", "right")}
    master = Master(System(halves, CONNECTIONS), STEP)
    if not compiled:
        master._loop = False

    def run(n: int) -> None:
        if n == 1:
            master.step()
        else:
            master.run(master.time + n * STEP)

    return run, lambda: (master.value("left.x"), master.value("right.x")), master.close


def fmpy_loop(folder: Path) -> Turn:
    """FMPy's own methods in a loop: set, step and get, on the values of the last step."""
    halves = []
    for side in ("left", "right"):
        description = fmpy.read_model_description(str(folder / f"{side}2.fmu"))
        assert description.coSimulation is not None
        half = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(folder / f"{side}2.fmu"), str(folder / f"fmpy-{side}")),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=side,
        )
        half.instantiate()
        half.setupExperiment(startTime=0.0)
        half.enterInitializationMode()
        half.exitInitializationMode()
        halves.append(half)
    left, right = halves
    shown = [left.getReal([X, V]), right.getReal([X, FORCE])]
    count = 0

    def run(n: int) -> None:
        nonlocal count
        for _ in range(n):
            motion, (_, force) = shown
            left.setReal([FORCE_IN], [force])
            right.setReal([X_IN, V_IN], motion)
            now = count * STEP
            left.doStep(now, STEP)
            right.doStep(now, STEP)
            shown[:] = left.getReal([X, V]), right.getReal([X, FORCE])
            count += 1

    return run, lambda: (shown[0][0], shown[1][0]), lambda: [half.freeInstance() for half in halves]


def libcosim(folder: Path) -> Turn:
    """libcosim's fixed-step algorithm."""
    from libcosimpy import CosimLogging
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    CosimLogging.log_output_level(CosimLogging.CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(round(STEP * 1e9))
    slaves = [CosimLocalSlave(str(folder / f"{side}2.fmu"), side) for side in ("left", "right")]
    left, right = (execution.add_local_slave(slave) for slave in slaves)
    execution.connect_real_variables(right, FORCE, left, FORCE_IN)
    execution.connect_real_variables(left, X, right, X_IN)
    execution.connect_real_variables(left, V, right, V_IN)
    observer: Any = None

    def show() -> tuple[float, float]:
        nonlocal observer
        if observer is None:  # none while it is timed
            observer = CosimObserver.create_last_value()
            execution.add_observer(observer)
            return 1.0, 0.0
        return observer.last_real_values(left, [X])[0], observer.last_real_values(right, [X])[0]

    return lambda n: execution.step(n), show, lambda: None


def ecos(folder: Path) -> Turn:
    """Ecos' fixed-step algorithm, from an SSP file that snarelab wrote."""
    for library in Path(sys.prefix).glob("lib/libtbb.so.12"):
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)  # Ecos wants it and does not look there
    import ecospy

    ecospy.EcosLib.set_log_level("off")
    simulation = ecospy.EcosSimulation(STEP, ssp_path=str(folder / "system.ssp"))
    simulation.init()
    return (
        simulation.step,
        lambda: (simulation.get_real("left::x"), simulation.get_real("right::x")),
        simulation.free,
    )


def largest_error(make: Callable[[], Turn]) -> float:
    """Largest position error [m] over ten seconds."""
    run, show, end = make()
    found = np.empty((10_001, 2))
    for k in range(len(found)):
        found[k] = show()
        if k + 1 < len(found):
            run(1)
    end()
    return float(np.abs(found - exact(np.arange(len(found)) * STEP)).max())


def microseconds(make: Callable[[], Turn], n: int) -> tuple[float, float]:
    """Time a step by the clock and by the process."""
    run, _, end = make()
    run(10)  # what is built at the first steps
    clock, process = time.perf_counter(), time.process_time()
    run(n)
    took = (time.perf_counter() - clock) / n * 1e6, (time.process_time() - process) / n * 1e6
    end()
    return took


def main() -> int:
    """Run, compare, print and write; 1 where ours misses its goal."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/cosim.json")
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = {side: build(folder, side, 2) for side in ("left", "right")}
        write_ssp(Setup(System({s: Fmu(f) for s, f in files.items()}, CONNECTIONS), STEP), folder / "system.ssp")
        masters: dict[str, tuple[Callable[[], Turn], int]] = {
            "ours": (lambda: ours(folder), N_STEPS),
            "ours, in Python": (lambda: ours(folder, compiled=False), N_STEPS // 10),
            "FMPy's calls": (lambda: fmpy_loop(folder), N_STEPS),
            "libcosim": (lambda: libcosim(folder), N_STEPS),
            "Ecos": (lambda: ecos(folder), N_STEPS),
        }
        errors: dict[str, float] = {}
        for name, (make, _) in list(masters.items()):
            try:
                errors[name] = largest_error(make)
            except (ImportError, OSError) as reason:
                print(f"{name} is left out: {reason}", file=sys.stderr)
                del masters[name]
        turns = [{name: microseconds(make, n) for name, (make, n) in masters.items()} for _ in range(REPETITIONS)]
    for name in masters:
        clock, process = (float(np.median([turn[name][kind] for turn in turns])) for kind in (0, 1))
        ratio = float(np.median([turn[name][0] / turn["ours"][0] for turn in turns]))
        rows.append(
            {
                "name": name,
                "microseconds": clock,
                "cpu_microseconds": process,
                "times_ours": ratio,
                "error": errors[name],
            }
        )
    print(f"{N_STEPS} macro steps of two FMUs, {REPETITIONS} turns, {platform.machine()}")
    print(f"{'':20}{'us a step':>11}{'CPU':>8}{'x ours':>9}{'error m':>11}")
    for row in rows:
        print(
            f"{row['name']:20}{row['microseconds']:11.2f}{row['cpu_microseconds']:8.2f}{row['times_ours']:9.1f}"
            f"{row['error']:11.1e}"
        )
    result = {"bench": "cosim", "n_steps": N_STEPS, "step": STEP, "repetitions": REPETITIONS, "masters": rows}
    write_result(path, result)
    if rows[0]["cpu_microseconds"] > GOAL:
        print(f"ours takes {rows[0]['cpu_microseconds']:.2f} us a step, more than {GOAL}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
