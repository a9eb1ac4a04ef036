"""Kill snarelab at random moments: nothing that was reported done may be lost, no half file left, no process either.

``python bench/kills.py [--kills 200] [--seed 1] [--log FILE] [KIND ...]`` over identify, diagnose, cosim and tolerance.
Half of the moments are drawn evenly from the length of a run, half from its last sixth, where files are written. After
each kill every output must be absent, or what a run before left whole; every tolerance case, and every time of a cosim
run, that was reported must be on disk; and the processes that the run had started must end by themselves. At the end
the command is run undisturbed, and must leave what a run leaves that was never killed. The count and its log:
`bench/killed.py`.
"""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))

from bench.killed import Lost, begin, main, rows_left, settle

COMMANDS = ("identify", "diagnose", "cosim", "tolerance")
LOG = ROOT / "build" / "bench" / "kills.jsonl"
_ROWS = 800

_SYSTEM = """
step = 1e-3
stop = 10.0
[participants.left]
python = "snarelab.cosim.participants.oscillator:LeftOscillator"
[participants.right]
python = "snarelab.cosim.participants.oscillator:RightOscillator"
[connections]
"left.force" = "right.force"
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""

_CAPTURE = """
import os, time
import numpy as np
from snarelab.tolerance.capture import Axis, Capture, Outcome

def run(values):
    time.sleep(float(os.environ.get("CASE_SECONDS", "0")))
    error = np.hypot(values["radial_y"], values["radial_z"]) / 6
    return Outcome(bool(error < 0.02), error, 2.6, 5.0, 100.0)

CAPTURE = Capture("toy", tuple(Axis(n, "m", n, 0.0, -1.0, 1.0) for n in ("radial_y", "radial_z")), run)
"""

_STUDY = """
capture = "toy_capture:CAPTURE"
sampling = "sobol"
batch = 8
cases = 24
envelope = false
[ranges]
radial_y = [-0.1, 0.1]
radial_z = [-0.1, 0.1]
[success]
radial_error = 0.01
strength = 800.0
"""


def write_inputs(folder: Path) -> None:
    """What every command reads: a model with short recordings, a system of two masses, a study with a toy capture."""
    bundled = ROOT / "studies" / "bundled"
    for name in ("arm3.toml", "arm3.urdf"):
        shutil.copy(bundled / name, folder)
    for name in ("train.csv", "holdout.csv"):
        pd.read_csv(bundled / name, nrows=_ROWS).to_csv(folder / name, index=False)
    (folder / "system.toml").write_text(_SYSTEM)
    (folder / "toy_capture.py").write_text(_CAPTURE)
    (folder / "study.toml").write_text(_STUDY)


def words(command: str, out: str) -> list[str]:
    """A command's arguments, with outputs in the folder ``out``."""
    files = ["--json", f"{out}/out.json", "--save-model", f"{out}/out.toml"]
    return {
        "identify": ["identify", "arm3.toml", "train.csv", *files],
        "diagnose": [
            *("diagnose", "arm3.toml", "train.csv", "--holdout", "holdout.csv"),
            *(*files, "--report", f"{out}/out.html"),
        ],
        "cosim": ["cosim", "system.toml", "--out", f"{out}/out.csv", "-vv"],
        "tolerance": ["tolerance", "study.toml", "--out", f"{out}/results", "-vv"],
    }[command]


class Killed:
    """One command in one folder, killed again and again.

    Parameters
    ----------
    command : str
        One of `COMMANDS`.
    folder : Path
        An empty one.
    """

    def __init__(self, command: str, folder: Path) -> None:
        """Write the inputs, and run once undisturbed for what is to be left, and for how long it takes."""
        self.command, self.folder, self.recorded = command, folder, 0
        write_inputs(folder)
        begun = time.monotonic()
        self._run("wanted", None)
        self.length = time.monotonic() - begun
        (folder / "killed").mkdir()

    def kill(self, moments: random.Random) -> dict[str, Any]:
        """Kill one run, and look at what is left."""
        share = moments.uniform(0.0, 1.0) if moments.random() < 0.5 else moments.uniform(0.83, 1.1)
        status, took, log = self._run("killed", share * self.length)
        reported = [int(n) for n in re.findall(r"(\d+) of at most", log)]
        self.recorded = max([self.recorded, *reported])
        self._check()
        rows = rows_left(self.command, self.folder / "killed" / "out.csv", log if status else "")
        outcome = "killed" if status else "done before"
        return {"outcome": outcome, "moment": round(share * self.length, 3), "settled": round(took, 3), "rows": rows}

    def finish(self) -> None:
        """Run to the end in the folder of the killed runs; it must hold what an undisturbed run leaves."""
        self._run("killed", None)
        self._check()
        wanted, left = (
            {str(p.relative_to(self.folder / kind)) for p in (self.folder / kind).rglob("*")}
            for kind in ("wanted", "killed")
        )
        if left != wanted:
            raise Lost(f"{self.command}: {sorted(left ^ wanted)} are not what an undisturbed run leaves")

    def _run(self, out: str, moment: float | None) -> tuple[int, float, str]:
        """Run to the end, or kill at a moment [s]; status, time until all was gone, and the log."""
        (self.folder / out).mkdir(exist_ok=True)
        paths = os.pathsep.join([str(self.folder), os.environ.get("PYTHONPATH", "")])
        with tempfile.TemporaryFile("w+") as log:
            command = [sys.executable, "-m", "snarelab.cli", *words(self.command, out)]
            process, mark = begin(command, self.folder, log, PYTHONPATH=paths)
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                process.kill()
            status = process.wait()
            took = settle(self.command, mark, *([self.folder / "tmp"] if self.command == "cosim" else []))
            log.seek(0)
            said = log.read()
        if status != 0 and (moment is None or status != -signal.SIGKILL):
            raise Lost(f"{self.command}: ended with {status}: {said[-400:]}")
        return status, took, said

    def _check(self) -> None:
        """Every output is whole: the same as the undisturbed run's."""
        wanted, killed = self.folder / "wanted", self.folder / "killed"
        for path in killed.glob("out.*"):
            text, other = path.read_text(), (wanted / path.name).read_text()
            same = json.loads(text) == json.loads(other) if path.suffix == ".json" else text == other
            if not same and not (path.suffix == ".html" and text.endswith("</html>\n") and len(text) == len(other)):
                raise Lost(f"{self.command}: {path.name} is not whole")
        if self.command == "tolerance" and (killed / "results" / "cases").exists():
            frames = [pd.read_parquet(p) for p in (killed / "results" / "cases").glob("*.parquet")]
            count = len(pd.concat(frames)[["stage", "case"]].drop_duplicates()) if frames else 0
            if count < self.recorded:
                raise Lost(f"tolerance: {self.recorded} cases were reported recorded, {count} are there")


if __name__ == "__main__":
    sys.exit(main(__doc__ or "", COMMANDS, Killed, LOG))
