"""What kills at random moments have in common: how one is started and marked, what it must leave, and the count.

Every kill draws from its own generator and is a line of a log, with whatever harm was found; a count that was stopped
goes on where it was, as long as the program's sources are the same.
"""

import argparse
import hashlib
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TextIO

import snarelab

ORPHANS = 30.0
"""Longest that a process or a temporary file may outlive the one that wanted it [s]."""
_MARK = "SNARELAB_KILLS"


class Lost(AssertionError):
    """A kill did harm."""


class Trial(Protocol):
    """One kind of victim in a folder of its own."""

    def kill(self, moments: random.Random) -> dict[str, Any]:
        """Start one, kill it, and look; what happened, its ``outcome`` among it. Raises Lost where harm was done."""
        ...

    def finish(self) -> None:
        """What is to be looked at once all kills are done."""
        ...


def begin(words: Sequence[str], folder: Path, log: TextIO, **more: str) -> "tuple[subprocess.Popen[bytes], str]":
    """A process in a session of its own, with temporary files in ``folder/tmp``; and the mark of all it will start."""
    (folder / "tmp").mkdir(exist_ok=True)
    mark = f"{os.getpid()}-{random.SystemRandom().random()}"
    environment = {**os.environ, _MARK: mark, "TMPDIR": str(folder / "tmp"), "OMP_NUM_THREADS": "1", **more}
    process = subprocess.Popen(
        words, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
    )
    return process, mark


def alive(mark: str) -> list[int]:
    """Processes that a run started, by what stands in their environment."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"{_MARK}={mark}".encode() in (place / "environ").read_bytes():
                found.append(int(place.name))
        except OSError:
            continue
    return found


def settle(name: str, mark: str, *places: Path) -> float:
    """Wait until no process lives and these folders hold nothing [s]; raises Lost where that takes too long."""
    begun = time.monotonic()
    while left := [*alive(mark), *(path for place in places for path in place.iterdir())]:
        if time.monotonic() > begun + ORPHANS:
            raise Lost(f"{name}: {list(map(str, left))} {ORPHANS:g} s after the end")
        time.sleep(0.02)
    return time.monotonic() - begun


def rows_left(name: str, path: Path, log: str) -> int:
    """Rows of ``unfinished-NAME`` or NAME; raises Lost where one is broken or out of order, or lacks what was told."""
    unfinished = path.with_name(f"unfinished-{path.name}")
    found = unfinished if unfinished.exists() else path
    lines = found.read_text().split("\n")[:-1] if found.exists() else []
    rows = [[float(value) for value in line.split(",")] for line in lines[1:]]
    if any(len(row) != lines[0].count(",") + 1 for row in rows) or rows != sorted(rows):
        raise Lost(f"{name}: the rows of {found.name} cannot be read")
    told = re.findall(r"([\d.]+) s of [\d.]+ s", log)
    if told and (not rows or float(told[-1]) > rows[-1][0] + 1e-3):
        raise Lost(f"{name}: {told[-1]} s was reported, and rows end at {rows[-1][0] if rows else None} s")
    return len(rows)


def kill_all(
    kinds: Sequence[str], make: Callable[[str, Path], Trial], kills: int, seed: int, log: Path | None = None
) -> dict[str, Counter[str]]:
    """Kill each kind its share of times, one kind after the other; how often each outcome came.

    Parameters
    ----------
    kinds : sequence of str
    make : callable
        The trial of a kind, in an empty folder.
    kills, seed : int
    log : Path, optional
        Where a line is written after each kill; kills in it that the same sources gave are not done again.

    Raises
    ------
    Lost
        At the end, with every harm that was done.
    """
    version = _sources()
    lines = [json.loads(x) for x in log.read_text().splitlines()] if log and log.exists() else []
    have = {(x["kind"], x["number"]): x for x in lines if (x["seed"], x["version"]) == (seed, version)}
    for place, kind in enumerate(kinds):
        numbers = range(kills // len(kinds) + (place < kills % len(kinds)))
        left = [number for number in numbers if (kind, number) not in have]
        if left:
            with tempfile.TemporaryDirectory(prefix="snarelab-kills-") as folder:
                trial = make(kind, Path(folder))
                for number in left:
                    line = have[kind, number] = {"kind": kind, "number": number, "seed": seed, "version": version}
                    try:
                        line |= trial.kill(random.Random(f"{seed} {kind} {number}"))
                    except Lost as harm:
                        line |= {"outcome": "harm", "harm": str(harm)}
                        print(harm, file=sys.stderr, flush=True)
                    if log:
                        _append(log, line)
                trial.finish()
        print(f"{kind:<10} {dict(_outcomes(have, kind))}", flush=True)
    if harms := [line["harm"] for line in have.values() if "harm" in line]:
        raise Lost(f"{len(harms)} of {kills} kills did harm: " + "; ".join(harms))
    return {kind: _outcomes(have, kind) for kind in kinds}


def main(about: str, kinds: Sequence[str], make: Callable[[str, Path], Trial], log: Path) -> int:
    """Read the arguments and kill; 1 where harm was done."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(kinds)} (all)")
    parser.add_argument("--kills", type=int, default=200, help="altogether (200)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--log", type=Path, default=log, help=f"a line a kill; goes on where it ends ({log})")
    given = parser.parse_args()
    if unknown := [kind for kind in given.kinds if kind not in kinds]:
        parser.error(f"unknown {unknown[0]}; choose of {', '.join(kinds)}")
    try:
        kill_all(given.kinds or kinds, make, given.kills, given.seed, given.log)
    except Lost as harm:
        print(harm, file=sys.stderr)
        return 1
    return 0


def _outcomes(have: Mapping[tuple[str, int], Mapping[str, Any]], kind: str) -> Counter[str]:
    return Counter(line["outcome"] for line in have.values() if line["kind"] == kind)


def _append(log: Path, line: Mapping[str, Any]) -> None:
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("a") as file:
        file.write(json.dumps(line) + "\n")
        file.flush()
        os.fsync(file.fileno())


def _sources() -> str:
    """SHA-256 over the sources that runs, FMUs and their ends follow from."""
    package = Path(next(iter(snarelab.__path__)))
    paths = [*package.glob("*.py"), *(path for name in ("cosim", "fmu") for path in (package / name).rglob("*.[pch]*"))]
    total = hashlib.sha256()
    for path in sorted(path for path in paths if path.suffix in (".py", ".c", ".h")):
        total.update(path.read_bytes())
    return total.hexdigest()
