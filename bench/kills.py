"""Kill snarelab at random moments: nothing that was reported done may be lost, no half file left, no process either.

``python bench/kills.py [--kills 200] [--seed 1] [COMMAND ...]`` over identify, diagnose, cosim and tolerance. Half of
the moments are drawn evenly from the length of a run, half from its last sixth, where files are written. After each
kill every output must be absent, or what a run before left whole; every tolerance case, and every time of a cosim run,
that was reported must be on disk; and the processes that the run had started must end by themselves. At the end the
command is run undisturbed, and must leave what a run leaves that was never killed.
"""

import argparse
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
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = ("identify", "diagnose", "cosim", "tolerance")
ORPHANS = 30.0
"""Longest that a process may live on after the one that started it [s]."""
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


class Lost(AssertionError):
    """A kill did harm."""


@dataclass
class Trial:
    """One command in one folder, killed again and again.

    Parameters
    ----------
    command : str
        One of `COMMANDS`.
    folder : Path
        An empty one.
    """

    command: str
    folder: Path
    recorded: int = 0
    reached: float = 0.0
    outcomes: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        """Write the inputs, and run once undisturbed for what is to be left, and for how long it takes."""
        write_inputs(self.folder)
        begun = time.monotonic()
        self.run("wanted", None)
        self.length = time.monotonic() - begun
        (self.folder / "killed").mkdir()

    def run(self, out: str, moment: float | None) -> None:
        """Run to the end, or kill at a moment [s]; raises Lost where an undisturbed run fails."""
        (self.folder / out).mkdir(exist_ok=True)
        mark = f"{os.getpid()}-{random.random()}"
        (self.folder / "tmp").mkdir(exist_ok=True)
        paths = os.pathsep.join([str(self.folder), os.environ.get("PYTHONPATH", "")])
        with tempfile.TemporaryFile("w+") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "snarelab.cli", *words(self.command, out)],
                cwd=self.folder,
                env={
                    **os.environ,
                    "PYTHONPATH": paths,
                    "OMP_NUM_THREADS": "1",
                    "SNARELAB_KILLS": mark,
                    "TMPDIR": str(self.folder / "tmp"),
                },
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.wait()
            log.seek(0)
            self._settled(mark, log.read(), process.returncode, moment)

    def kill(self, moments: random.Random) -> None:
        """Kill one run, and look at what is left."""
        share = moments.uniform(0.0, 1.0) if moments.random() < 0.5 else moments.uniform(0.83, 1.1)
        self.run("killed", share * self.length)
        self._check()

    def finish(self) -> None:
        """Run to the end in the folder of the killed runs; it must hold what an undisturbed run leaves."""
        self.run("killed", None)
        self._check()
        for kind in ("wanted", "killed"):
            left = {str(p.relative_to(self.folder / kind)) for p in (self.folder / kind).rglob("*")}
            if kind == "wanted":
                wanted = left
            elif left != wanted:
                raise Lost(f"{self.command}: {sorted(left ^ wanted)} are not what an undisturbed run leaves")

    def _settled(self, mark: str, log: str, status: int, moment: float | None) -> None:
        if moment is None and status != 0:
            raise Lost(f"{self.command}: an undisturbed run ended with {status}: {log[-400:]}")
        if status not in (0, -signal.SIGKILL):
            raise Lost(f"{self.command}: ended with {status}: {log[-400:]}")
        self.outcomes["killed" if status else "done before"] += 1
        if moment is not None:
            reported = [int(n) for n in re.findall(r"(\d+) of at most", log)]
            self.recorded = max([self.recorded, *reported])
            times = [float(t) for t in re.findall(r"([\d.]+) s of [\d.]+ s", log)]
            self.reached = max([0.0, *times]) if status else 0.0
        deadline = time.monotonic() + ORPHANS
        while left := alive(mark):
            if time.monotonic() > deadline:
                raise Lost(f"{self.command}: processes {left} live on {ORPHANS:g} s after their parent was killed")
            time.sleep(0.05)
        if self.command == "cosim" and (lost := [*(self.folder / "tmp").rglob("*")]):
            raise Lost(f"cosim: {lost} lie about after the run's end")

    def _check(self) -> None:
        """Every output is whole: the same as the undisturbed run's."""
        wanted, killed = self.folder / "wanted", self.folder / "killed"
        for path in killed.glob("out.*"):
            text, other = path.read_text(), (wanted / path.name).read_text()
            same = json.loads(text) == json.loads(other) if path.suffix == ".json" else text == other
            if not same and not (path.suffix == ".html" and text.endswith("</html>\n") and len(text) == len(other)):
                raise Lost(f"{self.command}: {path.name} is not whole")
        if self.reached > 0:
            unfinished = killed / "unfinished-out.csv"
            rows = pd.read_csv(unfinished if unfinished.exists() else killed / "out.csv")
            if rows["time"].iloc[-1] < self.reached - 1e-3:
                raise Lost(f"cosim: {self.reached} s were reported, and rows end at {rows['time'].iloc[-1]} s")
        if self.command == "tolerance" and (killed / "results" / "cases").exists():
            frames = [pd.read_parquet(p) for p in (killed / "results" / "cases").glob("*.parquet")]
            count = len(pd.concat(frames)[["stage", "case"]].drop_duplicates()) if frames else 0
            if count < self.recorded:
                raise Lost(f"tolerance: {self.recorded} cases were reported recorded, {count} are there")


def alive(mark: str) -> list[int]:
    """Processes that a run started, by what stands in their environment."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"SNARELAB_KILLS={mark}".encode() in (place / "environ").read_bytes():
                found.append(int(place.name))
        except OSError:
            continue
    return found


def kill_all(commands: Sequence[str], kills: int, seed: int) -> dict[str, Counter[str]]:
    """Kill each command its share of times; raises Lost at the first harm done."""
    moments, result = random.Random(seed), {}
    for number, command in enumerate(commands):
        count = kills // len(commands) + (number < kills % len(commands))
        with tempfile.TemporaryDirectory(prefix="snarelab-kills-") as folder:
            trial = Trial(command, Path(folder))
            trial.outcomes.clear()
            for _ in range(count):
                trial.kill(moments)
            trial.outcomes["runs"] = count
            result[command] = Counter(trial.outcomes)
            trial.finish()
            print(f"{command:<10} {dict(result[command])}, a run takes {trial.length:.1f} s", flush=True)
    return result


def main() -> int:
    """Read the arguments; 1 where harm was done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("commands", nargs="*", metavar="COMMAND", default=COMMANDS)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    try:
        kill_all(given.commands or COMMANDS, given.kills, given.seed)
    except Lost as harm:
        print(harm, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
