"""Write cases; one that is there is not made again."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from .cases import GROUPS, planned, write
from .residuals import RECORDINGS, residuals
from .robots import published


def make(folder: Path, seed: int, count: int, group: str = "", tell: Callable[[str], None] = print) -> list[Path]:
    """Folders of the first ``count`` cases of a seed, or of those among them of one group.

    Raises
    ------
    ValueError
        ``folder`` holds cases of another seed; or the real recordings, or the published arms, are not there.
    """
    if not residuals():
        raise ValueError(f"no recordings in {RECORDINGS}: there is nothing to play")
    if not published():
        raise ValueError("the package example-robot-data is not installed: make .venv/installed does it")
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / "seed.json"
    if mark.exists() and json.loads(mark.read_text())["seed"] != seed:
        raise ValueError(f"{folder} holds cases of seed {json.loads(mark.read_text())['seed']}; give another folder")
    mark.write_text(json.dumps({"seed": seed}) + "\n")
    plans = planned(seed, count)
    wanted = [k for k, plan in enumerate(plans) if group in ("", plan.group)]
    folders = []
    for done, k in enumerate(wanted, 1):
        path = folder / f"{k:04}"
        folders.append(path)
        if (path / "truth.json").exists():
            continue
        start = time.perf_counter()
        write(plans[k], seed, k, path)
        what = ", ".join(f"{name} {size:g}x" for name, size in plans[k].concealed) or "nothing"
        tell(f"{done}/{len(wanted)} {path}: {plans[k].group}, {what}; {time.perf_counter() - start:.1f} s")
    return folders


def main() -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof.played", description="Cases of the third generator.")
    parser.add_argument("command", choices=("make",))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, required=True)
    parser.add_argument("--group", choices=GROUPS, default="")
    given = parser.parse_args()
    try:
        make(given.folder, given.seed, given.cases, given.group, lambda words: print(words, flush=True))
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; the same command goes on where it was", file=sys.stderr)
        return 130
    return 0
