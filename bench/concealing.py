"""What benches that conceal effects and let a diagnosis name them have in common: arguments, cases that go on, table.

A case is one effect and one seed. Every case done is a line of a log and is not done again, so that a run that was
broken off goes on where it was; the table of all is printed at the end.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def main(
    about: str,
    effects: Sequence[str],
    run_case: Callable[[str, int, Path], Row],
    record: Callable[[str, int, Path], Any],
    line: Callable[[Row], str],
    out: Path,
    arguments: Sequence[str] | None = None,
) -> int:
    """Read the arguments, do what is not done yet, and print.

    Parameters
    ----------
    about : str
        For ``--help``.
    effects : sequence of str
    run_case : callable
        Effect, seed, and a folder for recordings; what is worth keeping, ``effect``, ``seed``, ``right`` among it.
    record : callable
        Writes a case's recordings only.
    line : callable
        One case in words.
    out : path
        Where a line of JSON is added for each case.
    arguments : sequence of str, optional
        In place of the process's own.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", nargs="+", choices=effects, default=effects)
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--keep", type=Path, help="folder for the recordings; made there once")
    parser.add_argument("--record", action="store_true", help="make the recordings only")
    given = parser.parse_args(arguments)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(text) for text in given.out.read_text().splitlines()] if given.out.exists() else []
    have = {(row["effect"], row["seed"]) for row in rows}
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for seed, effect in ((seed, effect) for seed in given.seeds for effect in given.only):
            if (effect, seed) in have:
                continue
            if given.record:
                record(effect, seed, folder)
                continue
            rows.append(run_case(effect, seed, folder))
            append(given.out, rows[-1])
            print(line(rows[-1]), flush=True)
    if rows:
        print(table(rows, effects, line))
    return 0


def table(rows: Sequence[Row], effects: Sequence[str], line: Callable[[Row], str]) -> str:
    """One line a case, then how often each effect was named alone, and nothing where nothing was concealed."""
    lines = [line(row) for row in sorted(rows, key=lambda row: (effects.index(row["effect"]), row["seed"]))]
    for effect in effects:
        right = [row["right"] for row in rows if row["effect"] == effect]
        if right:
            lines.append(f"{effect}: {sum(right)} of {len(right)}")
    return "\n".join(lines)


def append(path: Path, row: Row) -> None:
    """Add a line that is on the disk when this returns."""
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")
        file.flush()
        os.fsync(file.fileno())
