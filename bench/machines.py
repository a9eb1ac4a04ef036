"""Does the tool name what motors, gears, grease, springs and coupled wrists do? On recordings of MuJoCo's arms.

    python bench/machines.py [--seeds 1-10] [--effects gear_efficiency,clean] [--keep FOLDER]

Each case is a random arm of three or four joints with LuGre friction on all, a disturbance that wanders, encoders of 17
to 20 bits, and one concealed mechanism of twice the disturbance's RMS in torque that the friction of the model cannot
pose as (`bench/machine_effects.py`); then ``diagnose`` is asked. A case done is a line in
``build/bench/machines.jsonl`` and is not done again: the bench may be stopped and gone on with. The table counts what
the file holds.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.concealing import append
from bench.machine_case import ALONE, NOTHING, OUTCOMES, run_case
from bench.machine_effects import ENTRIES
from snarelab.errors import InputError, nearest

RESULTS = Path("build/bench/machines.jsonl")
INTERRUPTED = 130


def listed() -> list[str]:
    """Entries that the vocabulary has names for."""
    return [name for name, entry in ENTRIES.items() if entry.listed]


def seeds_of(text: str) -> list[int]:
    """``1-3,7`` as 1, 2, 3, 7; InputError for anything else."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise InputError(f"--seeds {text!r}: give numbers and ranges, such as 1-10 or 1,4,7-9")
        found += range(int(first), int(last or first) + 1)
    return found


def entries_of(text: str) -> list[str]:
    """Entries by their own names or by that of the effect that they conceal; InputError for others."""
    found: list[str] = []
    for word in text.split(","):
        own = [e for e in listed() if word == e or word in ENTRIES[e].effects]
        if not own:
            raise InputError(f"--effects: no {word!r} here; did you mean {nearest(word, listed())!r}?")
        found += [e for e in own if e not in found]
    return found


def done(path: Path) -> list[dict[str, Any]]:
    """Every case of a file, none where there is no file; a last line that was broken off is cut away."""
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        print(f"{path}: the last line was broken off and is dropped", file=sys.stderr)
        path.write_text(whole, encoding="utf-8")
    rows = []
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError as fault:
            raise InputError(f"{path}, line {number}: not JSON ({fault.msg}); mend it or give another --out") from fault
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Outcomes by entry, as counts; of the clean ones no name is right."""
    lines = [f"{'concealed':<28}" + "".join(f"{o:>14}" for o in OUTCOMES) + f"{'cases':>8}{'right':>8}"]
    for entry in ENTRIES:
        own = [row["outcome"] for row in rows if row["effect"] == entry]
        if own:
            right = own.count(ALONE if ENTRIES[entry].effects else NOTHING)
            lines.append(f"{entry:<28}" + "".join(f"{own.count(o):>14}" for o in OUTCOMES) + f"{len(own):>8}{right:>8}")
    return "\n".join(lines)


def line(row: dict[str, Any]) -> str:
    """One case in words."""
    true = ", ".join(f"{name} at {at}" for name, at in row["truths"]) or "nothing"
    told = ", ".join(f"{e['name']} at {e['at']} ({e['probability']:.2f})" for e in row["named"]) or "no name"
    return f"{row['effect']} {row['seed']}: {true} -> {told}; {row['verdict']}: {row['outcome']}, {row['seconds']:g} s"


def main(arguments: Sequence[str] | None = None) -> int:
    """Do what is not done yet, then print the table; status 130 where it was interrupted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1-10")
    parser.add_argument("--effects", help=f"with commas between: {', '.join(listed())}")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--keep", type=Path, help="folder for models and recordings, one folder a case")
    given = parser.parse_args(arguments)
    try:
        seeds, entries = seeds_of(given.seeds), entries_of(given.effects) if given.effects else listed()
        rows = done(given.out)
    except InputError as fault:
        print(fault, file=sys.stderr)
        return 2
    have = {(row["effect"], row["seed"]) for row in rows}
    given.out.parent.mkdir(parents=True, exist_ok=True)
    status = 0
    try:
        for seed, entry in ((s, e) for s in seeds for e in entries if (e, s) not in have):
            with tempfile.TemporaryDirectory() as scratch:
                folder = given.keep / f"{entry}-{seed}" if given.keep else Path(scratch)
                rows.append(run_case(entry, seed, folder))
            append(given.out, rows[-1])
            print(line(rows[-1]), flush=True)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        status = INTERRUPTED
    print(table(rows))
    return status


if __name__ == "__main__":
    sys.exit(main())
