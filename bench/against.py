"""A step's time here over that in another checkout of this program, in turns: co-simulation, and the C FMU.

``python bench/against.py OTHER/snarelab [--only KIND] [--pairs 25] [--cpu 0] [--json RESULT.json]``. Each checkout has
a process of its own, pinned to one processor with one thread; they take turns of a fraction of a second, ours first in
every other pair. What is compared is the median of the pairs' ratios, of CPU time; a step of participants in processes
of their own, and of an FMU with Python beside it, is mostly waiting, and is taken by the clock. The steps are those of
`bench/cosim.py` and `bench/fmu.py`. Exit status 1 where ours takes over 5 % more for the loop in C, the loop in Python
or the C FMU.
"""

import argparse
import os
import platform
import subprocess
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np

from bench.results import write_result

HERE = Path(__file__).resolve().parents[1]
BAR = 1.05
KINDS = {
    "loop in C": True,
    "loop in Python": True,
    "C FMU": True,
    "processes of their own": False,
    "FMU with Python": False,
}
"""What is timed, and whether it is held to the bar."""

_TURNS = r"""
import ctypes, sys, tempfile, time
from pathlib import Path
import bench.cosim as cosim, bench.fmu as arm, snarelab
from bench.fmu_models import Slave, everywhere, write_model
from snarelab.cosim.participants.fmu import Fmu
from snarelab.cosim.process import OwnProcess
from snarelab.fmu.build import write_fmu
from snarelab.fmu.export import model_equations
from snarelab.fmu.hosted import write_hosted
from snarelab.models.model_file import load_model

def apart():
    halves = {s: OwnProcess(Fmu, folder / f"{s}2.fmu") for s in ("left", "right")}
    master = cosim.Master(cosim.System(halves, cosim.CONNECTIONS), cosim.STEP)
    return lambda n: master.run(master.time + n * cosim.STEP), None, master.close

def self_contained():
    values = everywhere("viscous_friction", "coefficient", arm.VISCOUS)
    values |= everywhere("coulomb_friction", "level", arm.COULOMB)
    values |= {f"speed_scale.joint{k}": arm.SPEED_SCALE for k in range(1, arm.N + 1)}
    model = write_model(folder, "six", arm.N, '["viscous_friction", "coulomb_friction"]', values)
    write_fmu(model_equations(load_model(model), stiff=False), folder / "six.fmu", 2)
    return Slave(folder / "six.fmu", folder / "six", arm.start())

def stepping(slave, library):
    do_step = ctypes.CDLL(str(next((folder / library / "binaries").glob("*/*")))).fmi2DoStep
    do_step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
    saved, component, start = slave.save(), slave.fmu.component, slave.time
    def turn(n, clock):
        slave.restore(saved)
        began = clock()
        for k in range(n):
            do_step(component, start + k * 1e-3, 1e-3, 0)
        return (clock() - began) / n * 1e6
    return turn

with tempfile.TemporaryDirectory() as scratch:
    folder = Path(scratch)
    for side in ("left", "right"):
        cosim.build(folder, side, 2)
    write_hosted("left_oscillator", folder / "hosted.fmu", 2)
    arm_step = stepping(self_contained(), "six")
    hosted_step = stepping(Slave(folder / "hosted.fmu", folder / "hosted", {"force": 1.0}), "hosted")
    together = apart()
    def apart_step(n):
        began = time.perf_counter()
        together[0](n)
        return (time.perf_counter() - began) / n * 1e6
    turns = {
        "loop in C": lambda: cosim.microseconds(lambda: cosim.ours(folder), 100_000)[1],
        "loop in Python": lambda: cosim.microseconds(lambda: cosim.ours(folder, compiled=False), 4000)[1],
        "C FMU": lambda: arm_step(20_000, time.process_time),
        "processes of their own": lambda: apart_step(500),
        "FMU with Python": lambda: hosted_step(3000, time.perf_counter),
    }
    print(snarelab.__path__[0], flush=True)
    for line in sys.stdin:
        print(repr(turns[line.strip()]()), flush=True)
    together[2]()
"""


class Checkout:
    """A checkout's process, which times what it is told."""

    def __init__(self, place: Path, cpu: int) -> None:
        """Start; raises RuntimeError where another copy of the program answers."""
        paths = os.pathsep.join([str(place.parent), str(place)])
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            ["taskset", "-c", str(cpu), sys.executable, "-c", _TURNS],
            cwd=place,
            env={**os.environ, **threads, "PYTHONPATH": paths},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        answered = self._answer()
        if Path(answered) != place:
            raise RuntimeError(f"{answered} was loaded, not {place}; its folder must be called snarelab")

    def microseconds(self, kind: str) -> float:
        """A step's time."""
        assert self._process.stdin is not None
        self._process.stdin.write(kind + "\n")
        self._process.stdin.flush()
        return float(self._answer())

    def close(self) -> None:
        """End."""
        self._process.communicate()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"a checkout's process ended with {self._process.wait()}")
        return line.strip()


def main() -> int:
    """Take turns, print and write; 1 where ours is slower."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("other", type=Path, help="a checkout, in a folder called snarelab")
    parser.add_argument("--only", action="append", choices=KINDS)
    parser.add_argument("--pairs", type=int, default=25)
    parser.add_argument("--cpu", type=int, default=0)
    parser.add_argument("--json", type=Path, default=Path("build/bench/against.json"))
    given = parser.parse_args()
    both = [Checkout(place.resolve(), given.cpu) for place in (HERE, given.other)]
    slower, rows = False, []
    print(f"{'':24}{'here':>9}{'other':>9}{'ratio':>8}   quartiles   {given.pairs} pairs, {platform.machine()}")
    for kind in given.only or KINDS:
        times = np.empty((given.pairs + 1, 2))
        for pair in range(len(times)):
            for side in (0, 1) if pair % 2 else (1, 0):
                times[pair, side] = both[side].microseconds(kind)
        times = times[1:]  # the first warms up
        low, ratio, high = map(float, np.percentile(times[:, 0] / times[:, 1], (25, 50, 75)))
        here, other = map(float, np.median(times, axis=0))
        slower |= KINDS[kind] and ratio > BAR
        print(f"{kind:24}{here:9.2f}{other:9.2f}{ratio:8.3f}   {low:.3f} to {high:.3f}", flush=True)
        rows.append({"kind": kind, "here": here, "other": other, "ratio": ratio, "quartiles": [low, high]})
    for one in both:
        one.close()
    write_result(given.json, {"bench": "against", "pairs": given.pairs, "microseconds": rows})
    return int(slower)


if __name__ == "__main__":
    sys.exit(main())
