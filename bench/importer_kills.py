"""Kill importers of FMUs at random moments: no process, no temporary file is left, and what was written can be read.

``python bench/importer_kills.py [--kills 200] [--seed 1] [IMPORTER ...]`` over these importers, each with FMUs that
have Python beside them (`snarelab.fmu.hosted`):

- ``c``: a program without any Python in it (``tests/fmu_host.c``);
- ``python``: FMPy's calls from Python, writing a row at each step;
- ``cosim``: ``snarelab cosim`` with such an FMU, one in C, and one that hangs half-way.

Importers run with one or more of descriptors 0 to 2 closed, as daemons do, or with all. Half the moments are drawn from
the whole run, half from after its first step; half of the kills go to the importer, half to its process group.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))

import fmpy

from bench.kills import ORPHANS, Lost, alive
from bench.oscillator_fmu import build
from snarelab.fmu.archive import open_fmu
from snarelab.fmu.hosted import write_hosted
from snarelab.models.c_library import find_compiler

IMPORTERS = ("c", "python", "cosim")
_CLOSED = ((), (), (2,), (0,), (0, 1, 2), (1, 2))
_LONG = 10_000_000  # steps: more than any run comes to

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
step = 1e-3
stop = 1000.0
[participants.left]
fmu = "../hosted.fmu"
[participants.right]
fmu = "../right2.fmu"
parameters = { fault = 2, fault_time = 1.0 }
[connections]
"left.force" = "right.force"
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""


@dataclass
class Importers:
    """Importers in one folder, and what became of their runs.

    Parameters
    ----------
    folder : Path
        An empty one.
    """

    folder: Path
    lengths: dict[str, float] = field(default_factory=dict)
    outcomes: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        """Build FMUs and programs."""
        write_hosted("left_oscillator", self.folder / "hosted.fmu", 2)
        build(self.folder, "right", 2)
        archive = open_fmu(self.folder / "hosted.fmu", self.folder / "hosted")
        host = self.folder / "fmu_host"
        compiler, _ = find_compiler("", os.environ["PATH"])
        headers = Path(fmpy.__file__).parent / "c-code"
        source = ROOT / "tests" / "fmu_host.c"
        subprocess.run([*compiler, "-DFMI=2", f"-I{headers}", "-w", str(source), "-o", str(host), "-ldl"], check=True)
        outputs = [v.valueReference for v in archive.description.modelVariables if v.causality == "output"]
        resources = str(self.folder / "hosted" / "resources")
        self.commands = {
            "c": [
                *(str(host), str(archive.binary), archive.description.guid, resources),
                *(str(len(outputs)), str(outputs[0]), str(_LONG), "0.01"),
            ],
            "python": [
                *(sys.executable, "-c"),
                _STEPPING.format(root=str(ROOT), fmu=f"{self.folder}/hosted.fmu", folder=f"{self.folder}/hosted"),
            ],
            "cosim": [sys.executable, "-m", "snarelab.cli", "cosim", "system.toml", "--out", "rows.csv", "-vv"],
        }

    def kill(self, kind: str, moments: random.Random) -> None:
        """Start one, kill it, and look at what is left."""
        closed = moments.choice(_CLOSED) if kind != "cosim" else ()
        if kind not in self.lengths:
            self._run(kind, closed, None, False)
        after_first = moments.random() < 0.5
        moment = moments.uniform(0.0, 1.5 if after_first else self.lengths[kind] + 1.0)
        self._run(kind, closed, (after_first, moment), moments.random() < 0.5)

    def _run(self, kind: str, closed: Sequence[int], when: tuple[bool, float] | None, group: bool) -> None:
        """Run until a moment [s] of the whole or after the first step; without one, measure when that comes."""
        mark = f"{os.getpid()}-{random.random()}"
        with tempfile.TemporaryDirectory(dir=self.folder) as name:
            here = Path(name)
            (here / "tmp").mkdir()
            (here / "system.toml").write_text(_SYSTEM)
            begun = time.monotonic()
            with (here / "log").open("w") as log:
                process = subprocess.Popen(
                    ["/bin/sh", "-c", " ".join(["exec", '"$@"', *(f"{d}>&-" for d in closed)]), "sh"]
                    + self.commands[kind],
                    cwd=here,
                    env={**os.environ, "SNARELAB_KILLS": mark, "TMPDIR": f"{name}/tmp", "OMP_NUM_THREADS": "1"},
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    start_new_session=True,
                )
                if when is None or when[0]:
                    self._wait_for_steps(kind, here, process, mark)
                    self.lengths.setdefault(kind, time.monotonic() - begun)
                time.sleep(when[1] if when else 0.0)
                if process.poll() is not None:
                    raise Lost(f"{kind}: ended by itself with {process.returncode}: {(here / 'log').read_text()}")
                (os.killpg if group else os.kill)(process.pid, signal.SIGKILL)
                process.wait()
            self._check(kind, here, mark)

    def _wait_for_steps(self, kind: str, here: Path, process: "subprocess.Popen[bytes]", mark: str) -> None:
        """Until rows are there, or with the C program its model's processes."""
        rows = here / ("rows.csv" if kind == "python" else "unfinished-rows.csv")
        deadline = time.monotonic() + 120.0
        while not (len(alive(mark)) == 5 if kind == "c" else rows.exists() and rows.stat().st_size > 100):
            if process.poll() is not None or time.monotonic() > deadline:
                raise Lost(f"{kind}: did not come to its first step: {(here / 'log').read_text()}")
            time.sleep(0.02)

    def _check(self, kind: str, here: Path, mark: str) -> None:
        """Nothing lives, nothing lies about, and every row that was reported is whole."""
        deadline = time.monotonic() + ORPHANS
        while left := [*alive(mark), *(here / "tmp").rglob("*")]:
            if time.monotonic() > deadline:
                raise Lost(f"{kind}: {left} {ORPHANS:g} s after the importer was killed")
            time.sleep(0.05)
        found = [*here.glob("*rows.csv")]
        lines = found[0].read_text().split("\n")[:-1] if found else []
        rows = [[float(value) for value in line.split(",")] for line in lines[1:]]
        if any(len(row) != lines[0].count(",") + 1 for row in rows) or rows != sorted(rows):
            raise Lost(f"{kind}: the rows cannot be read")
        told = [line for line in (here / "log").read_text().splitlines() if " s of " in line]
        if told and float(told[-1].split(" s of ")[0].split()[-1]) > rows[-1][0] + 1e-3:
            raise Lost(f"{kind}: {told[-1]!r} was reported, and rows end at {rows[-1][0]} s")
        self.outcomes[f"{kind}, with rows" if rows else kind] += 1


def kill_all(kinds: Sequence[str], kills: int, seed: int) -> Counter[str]:
    """Kill each its share of times; raises Lost at the first harm done."""
    moments = random.Random(seed)
    with tempfile.TemporaryDirectory(prefix="snarelab-importers-") as folder:
        importers = Importers(Path(folder))
        for number in range(kills):
            importers.kill(kinds[number % len(kinds)], moments)
        return importers.outcomes


def main() -> int:
    """Read the arguments; 1 where harm was done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("importers", nargs="*", metavar="IMPORTER", default=IMPORTERS)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    try:
        print(dict(kill_all(given.importers or IMPORTERS, given.kills, given.seed)))
    except Lost as harm:
        print(harm, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
