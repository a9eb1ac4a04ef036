"""Kill importers of FMUs at random moments: no process, no temporary file is left, and what was written can be read.

``python bench/importer_kills.py [--kills 200] [--seed 1] [--log FILE] [KIND ...]`` over these importers, each with FMUs
that have Python beside them (`snarelab.fmu.hosted`):

- ``c``: a program without any Python in it (``tests/helpers/fmu_host.c``);
- ``python``: FMPy's calls from Python, writing a row at each step;
- ``cosim``: ``snarelab cosim`` with such an FMU and one in C, which hangs after a while.

Importers run with one or more of descriptors 0 to 2 closed, as daemons do, or with all. Half the moments are drawn from
the time that a run takes to its first rows (``cosim`` reports once a second) and a second more, half from after them;
half of the kills go to the importer, half to its process group. The FMU that hangs does so anywhere before twice the
time of the first report, or, where the kill is to come after that, at three times. The count and its log:
`bench/killed.py`.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))

import fmpy

from bench.killed import Lost, alive, begin, main, rows_left, settle
from bench.oscillator_fmu import build
from snarelab.fmi.archive import open_fmu
from snarelab.fmu.hosted import write_hosted
from snarelab.models.c_library import find_compiler

IMPORTERS = ("c", "python", "cosim")
LOG = ROOT / "build" / "bench" / "importer_kills.jsonl"
_CLOSED = ((), (), (2,), (0,), (0, 1, 2), (1, 2))
_STEP = 1e-3  # s, macro step of `snarelab cosim`
_LONG = 10_000_000  # steps: more than any run comes to
_AFTER = 2.5  # s after the first rows within which half of the kills fall
_PROCESSES = 5  # of the C program: itself, and for each of two instances a warden and a worker

_STEPPING = """
import sys
sys.path.append({root!r})
from bench.fmu_models import Slave
slave = Slave({fmu!r}, {folder!r}, {{"force": 1.0}})
with open("rows.csv", "w", buffering=1) as rows:
    rows.write("time,x,v\\n")
    while True:
        slave.step(0.01)
        rows.write(",".join(map(repr, [slave.time, *map(float, slave.get())])) + "\\n")
"""

_SYSTEM = """
step = {step}
stop = 1000.0
[participants.left]
fmu = "../hosted.fmu"
[participants.right]
fmu = "../right2.fmu"
parameters = {{ fault = 2, fault_time = {fault_time!r} }}
[connections]
"left.force" = "right.force"
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""


class Importer:
    """One kind of importer in one folder, killed again and again.

    Parameters
    ----------
    kind : str
        One of `IMPORTERS`.
    folder : Path
        An empty one.
    """

    def __init__(self, kind: str, folder: Path) -> None:
        """Build FMUs and programs, and measure when the first step comes."""
        self.kind, self.folder = kind, folder
        write_hosted("left_oscillator", folder / "hosted.fmu", 2)
        build(folder, "right", 2)
        archive = open_fmu(folder / "hosted.fmu", folder / "hosted")
        if kind == "c":
            host = _compiled(folder)
            outputs = [v.valueReference for v in archive.description.modelVariables if v.causality == "output"]
            self.command = [
                *(str(host), str(archive.binary), archive.description.guid, str(folder / "hosted" / "resources")),
                *(str(len(outputs)), str(outputs[0]), str(_LONG), "0.01"),
            ]
        elif kind == "python":
            script = _STEPPING.format(root=str(ROOT), fmu=f"{folder}/hosted.fmu", folder=f"{folder}/hosted")
            self.command = [sys.executable, "-c", script]
        else:
            words = ["cosim", "system.toml", "--out", "rows.csv", "-vv"]
            self.command = [sys.executable, "-m", "snarelab.cli", *words]
        begun = time.monotonic()
        rows, _ = self._run((), True, 0.0, False)
        self.length, self.reached = time.monotonic() - begun, rows * _STEP

    def kill(self, moments: random.Random) -> dict[str, Any]:
        """Start one, kill it, and look at what is left."""
        closed = moments.choice(_CLOSED) if self.kind != "cosim" else ()
        after_first = moments.random() < 0.5
        moment = moments.uniform(0.0, _AFTER if after_first else self.length + 1.0)
        group = moments.random() < 0.5
        fault_time = self.reached * (3.0 if after_first else moments.uniform(0.0, 2.0))
        rows, took = self._run(closed, after_first, moment, group, fault_time)
        return {
            "outcome": "with rows" if rows else "without rows",
            "rows": rows,
            "closed": closed,
            "after_first": after_first,
            "moment": round(moment, 3),
            "group": group,
            "settled": round(took, 3),
        }

    def finish(self) -> None:
        """Nothing is left to look at: every kill has a folder of its own."""

    def _run(
        self, closed: Sequence[int], after_first: bool, moment: float, group: bool, fault_time: float = 1e300
    ) -> tuple[int, float]:
        """Run until a moment [s] of the whole or after the first step; rows, and the time until all was gone."""
        shell = ["/bin/sh", "-c", " ".join(["exec", '"$@"', *(f"{d}>&-" for d in closed)]), "sh"]
        with tempfile.TemporaryDirectory(dir=self.folder) as name:
            here = Path(name)
            (here / "system.toml").write_text(_SYSTEM.format(step=_STEP, fault_time=fault_time))
            with (here / "log").open("w") as log:
                process, mark = begin([*shell, *self.command], here, log)
            if after_first:
                self._wait_for_steps(here, process, mark)
            time.sleep(moment)
            ended = process.poll()
            if ended is None:
                (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
            process.wait()
            took = settle(self.kind, mark, here / "tmp")
            said = (here / "log").read_text()
            if ended is not None:
                raise Lost(f"{self.kind}: ended by itself with {ended}: {said}")
            return rows_left(self.kind, here / "rows.csv", said), took

    def _wait_for_steps(self, here: Path, process: "subprocess.Popen[bytes]", mark: str) -> None:
        """Until rows are there, or with the C program its model's processes."""
        rows = here / ("rows.csv" if self.kind == "python" else "unfinished-rows.csv")
        deadline = time.monotonic() + 120.0
        while not (len(alive(mark)) == _PROCESSES if self.kind == "c" else rows.exists() and rows.stat().st_size > 100):
            if process.poll() is not None or time.monotonic() > deadline:
                process.kill()
                raise Lost(f"{self.kind}: did not come to its first step: {(here / 'log').read_text()}")
            time.sleep(0.02)


def _compiled(folder: Path) -> Path:
    """The importer in C."""
    host = folder / "fmu_host"
    compiler, _ = find_compiler("", os.environ["PATH"])
    headers = Path(fmpy.__file__).parent / "c-code"
    source = ROOT / "tests" / "helpers" / "fmu_host.c"
    subprocess.run([*compiler, "-DFMI=2", f"-I{headers}", "-w", str(source), "-o", str(host), "-ldl"], check=True)
    return host


if __name__ == "__main__":
    sys.exit(main(__doc__ or "", IMPORTERS, Importer, LOG))
