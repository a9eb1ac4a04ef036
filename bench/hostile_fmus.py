"""Hostile FMUs in ``snarelab cosim``: each ends in one line, soon, within bounds, and leaves the others' data alone.

``python bench/hostile_fmus.py [--only NAME] [--json RESULT.json]``. A hostile half of the two oscillators
(`bench/hostile_fmu.c`) beside a sound one, or an archive that lies. Of every run: the seconds,
the most memory that its processes had together (proportional set size), what it said, the rows that it left, and that
no process and no temporary file is left. Exit status 1 where one is not as it must be. A machine that others load takes
longer: a run of two sound FMUs is measured first, and what it takes beyond three seconds is allowed to each.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

from bench.fmu_models import redescribed
from bench.killed import alive
from bench.oscillator_fmu import build
from bench.results import write_result

SECONDS, MEBIBYTES = 10.0, 500.0
"""What a hostile FMU may cost."""
FAULT_AT = 0.05
_USUAL = 3.0  # s of a run of sound FMUs where nothing else runs
_LIMIT = ("--timeout", "2")
_SYSTEM = """
step = 1e-2
stop = 0.2
[participants.left]
fmu = "{fmu}"
parameters = {{ {parameters} }}
[participants.right]
fmu = "right2.fmu"
[connections]
"left.force" = "right.force"
"right.x_left" = "left.x"
"right.v_left" = "left.v"
"""
STEP_FAULTS = {
    "error": 1, "hang": 2, "not a number": 3, "kills itself": 4, "discard": 5, "fatal": 6,
    "segmentation fault": 10, "abort": 11, "exit": 12, "stack overflow": 13, "division": 14,
    "closes descriptors": 15, "closes them and hangs": 16, "forks and crashes": 17, "daemon": 18, "forks 40, hangs": 19,
    "stops itself": 20, "kills its parent": 21, "kills its group": 22, "deaf, and hangs": 23, "garbage for answers": 24,
    "half an answer": 25, "overruns memory": 26, "infinite": 27, "unknown status": 28, "another program": 29,
    "spins": 30, "removes its folder": 31, "terminates itself": 32, "takes its limits away": 33, "broken pipe": 34,
    "closes its link": 35,
}  # fmt: skip
START_FAULTS = {"crash at start": 50, "hang at start": 51, "not a number at start": 52, "daemon at start": 55}
END_FAULTS = {"hang at end": 53, "crash at end": 54}
LOAD_FAULTS = {"crash when loaded": 1, "hang when loaded": 2}
SOUND = {"sound", "daemon", "daemon at start", "hang at end", "crash at end"}
"""Those that do their steps, so that the run ends well."""
KEEPS_NOTHING = {*START_FAULTS, *LOAD_FAULTS}


@dataclass(frozen=True)
class Found:
    """What one run cost and left.

    Parameters
    ----------
    name : str
    status : int
    seconds, mebibytes : float
    said : str
        Standard error, whole.
    rows : int
        Of the recording; 0 where there is none.
    left : tuple of str
        Processes and temporary files.
    """

    name: str
    status: int
    seconds: float
    mebibytes: float
    said: str
    rows: int
    left: tuple[str, ...]

    def problems(self, allowance: float = 0.0) -> list[str]:
        """What is not as it must be; ``allowance`` are seconds that the machine takes for itself."""
        archive, sound = self.name in ARCHIVES, self.name in SOUND
        keeps = not (archive or self.name in KEEPS_NOTHING or sound)
        wanted = 21 if sound else round(FAULT_AT / 1e-2) + 1 if keeps else 0
        checks = {
            f"status {self.status}": self.status == (0 if sound else 2),
            f"{self.said.count(chr(10))} lines": self.said.count("\n") == (0 if sound else 1),
            f"{self.seconds:.1f} s": self.seconds <= SECONDS + allowance,
            f"{self.mebibytes:.0f} MiB": self.mebibytes <= MEBIBYTES,
            f"{self.rows} rows, not {wanted}": self.rows == wanted,
            f"left {self.left}": not self.left,
        }
        return [text for text, good in checks.items() if not good]


def write_folder(folder: Path) -> None:
    """The sound half, and the hostile ones."""
    build(folder, "right", 2)
    build(folder, "left", 2, defined=("HOSTILE",)).rename(folder / "hostile.fmu")
    for name, number in LOAD_FAULTS.items():
        path = build(folder, "left", 2, defined=("HOSTILE", f"AT_LOAD={number}"))
        path.rename(folder / f"{name.replace(' ', '-')}.fmu")
    build(folder, "left", 2)
    build(folder, "left", 3)
    for name, change in ARCHIVES.items():
        change(folder, folder / f"{name.replace(' ', '-')}.fmu")


def run(folder: Path, name: str, allowance: float = 0.0) -> Found:
    """Run one in a folder that `write_folder` filled; it is ended where it takes longer by far than it may [s]."""
    fault = {**STEP_FAULTS, **START_FAULTS, **END_FAULTS}.get(name)
    fmu = "hostile.fmu" if fault else "left2.fmu" if name == "sound" else f"{name.replace(' ', '-')}.fmu"
    parameters = f"fault = {fault}, fault_time = {FAULT_AT}" if fault else ""
    with tempfile.TemporaryDirectory(dir=folder, prefix="run-") as place:
        here = Path(place)
        (here / "tmp").mkdir()
        system = folder / f"{here.name}.toml"
        system.write_text(_SYSTEM.format(fmu=fmu, parameters=parameters))
        mark = f"{os.getpid()}-{here.name}"
        begun = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, "-m", "snarelab.cli", "cosim", str(system), "--out", f"{here}/run.csv", *_LIMIT],
            env={**os.environ, "SNARELAB_KILLS": mark, "TMPDIR": str(here / "tmp"), "OMP_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        most = 0.0
        while process.poll() is None:
            most = max(most, sum(map(_memory, alive(mark))))
            time.sleep(0.2)
            if time.monotonic() > begun + 6 * (SECONDS + allowance):
                process.kill()
        seconds = time.monotonic() - begun
        time.sleep(0.3)
        left = [f"process {number}" for number in alive(mark)]
        left += [str(path.relative_to(here)) for path in (here / "tmp").rglob("*")]
        left += [path.name for path in here.glob("*") if path.name not in ("tmp", "run.csv")]
        rows = len((here / "run.csv").read_text().splitlines()) - 1 if (here / "run.csv").exists() else 0
        assert process.stderr is not None
        return Found(name, process.returncode, seconds, most, _answered(process), rows, tuple(left))


def _answered(process: "subprocess.Popen[str]") -> str:
    """Standard error; read to no end, which a process that was left would hold open."""
    assert process.stderr is not None
    os.set_blocking(process.stderr.fileno(), False)
    said = process.stderr.read() or ""
    process.stderr.close()
    return said


def _memory(process: int) -> float:
    """Proportional set size [MiB]."""
    with suppress(OSError):
        found = re.search(r"^Pss:\s+(\d+) kB", Path(f"/proc/{process}/smaps_rollup").read_text(), re.MULTILINE)
        return int(found[1]) / 1024 if found else 0.0
    return 0.0


def _with_variables(make: Callable[[], str]) -> Callable[[Path, Path], None]:
    """More variables in a sound FMU of FMI 3.0."""

    def change(folder: Path, target: Path) -> None:
        redescribed(
            folder / "left3.fmu", target, lambda t: t.replace("</ModelVariables>", f"{make()}</ModelVariables>")
        )

    return change


def _array(name: str, reference: int, size: str) -> str:
    return (
        f'<Float64 name="{name}" valueReference="{reference}" causality="output" variability="continuous">'
        f'<Dimension start="{size}"/></Float64>'
    )


def _wrong_reference(folder: Path, target: Path) -> None:
    redescribed(folder / "left2.fmu", target, lambda t: t.replace('valueReference="12"', 'valueReference="4000000000"'))


def _bomb(folder: Path, target: Path) -> None:
    redescribed(folder / "left2.fmu", target, lambda t: t)
    with zipfile.ZipFile(target, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("resources/zeros", "w") as entry:
        for _ in range(300):
            entry.write(bytes(1 << 20))


def _other_binary(folder: Path, target: Path) -> None:
    redescribed(folder / "left2.fmu", target, lambda t: t.replace('canGetAndSetFMUstate="true"', ""))
    with zipfile.ZipFile(target) as old:
        entries = {e.filename: old.read(e) for e in old.infolist()}
    with zipfile.ZipFile(target, "w") as new:
        for name, data in entries.items():
            new.writestr(name, data[: len(data) // 2] if name.startswith("binaries") else data)


ARCHIVES: dict[str, Callable[[Path, Path], None]] = {
    "2000 arrays of 100000": _with_variables(lambda: "".join(_array(f"a{k}", 100 + k, "100000") for k in range(2000))),
    "an array of 1e12": _with_variables(lambda: _array("a", 100, "1000000000000")),
    "an array of -1": _with_variables(lambda: _array("a", 100, "-1")),
    "an array of many": _with_variables(lambda: _array("a", 100, "many")),
    "references of nothing": _wrong_reference,
    "a bomb": _bomb,
    "half a binary": _other_binary,
}
NAMES = (*STEP_FAULTS, *START_FAULTS, *END_FAULTS, *LOAD_FAULTS, *ARCHIVES)


def main() -> int:
    """Run all, print and write; 1 where one is not as it must be."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", action="append", choices=NAMES)
    parser.add_argument("--json", default="build/bench/hostile_fmus.json")
    given = parser.parse_args()
    wrong, rows = 0, []
    with tempfile.TemporaryDirectory() as scratch:
        write_folder(Path(scratch))
        sound = run(Path(scratch), "sound", 6 * SECONDS)
        allowance = max(0.0, sound.seconds - _USUAL)
        print(f"a run of sound FMUs: {sound.seconds:.1f} s, {sound.mebibytes:.0f} MiB", *sound.problems(allowance))
        for name in given.only or NAMES:
            found = run(Path(scratch), name, allowance)
            if found.seconds > SECONDS + allowance:  # is the machine slower now?
                allowance = max(0.0, run(Path(scratch), "sound", 6 * SECONDS).seconds - _USUAL)
            problems = found.problems(allowance)
            wrong += bool(problems)
            said = found.said.strip().replace(scratch, "")[:150]
            rows.append({"name": name, "seconds": found.seconds, "mebibytes": found.mebibytes, "problems": problems})
            print(f"{name:24}{found.seconds:6.1f} s{found.mebibytes:6.0f} MiB {found.rows:3} rows  {said}", flush=True)
            for problem in problems:
                print(f"{'':24}WRONG: {problem}", flush=True)
    write_result(Path(given.json), {"bench": "hostile_fmus", "runs": rows})
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
