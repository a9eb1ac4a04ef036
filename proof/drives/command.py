"""The second proof: cases of drives simulated on Pinocchio's models, which share nothing with the first ones.

``python -m proof.drives make DIR --seed N --cases K``, then ``score DIR --out FILE.jsonl`` and ``table FILE.jsonl``,
from the repository's root. What was done is not done again. Seeds 1 to 99 are for work on the tool.
"""

import argparse
from pathlib import Path

from ..ending import status_of, tell
from .cases import GROUPS
from .make import make, written


def main() -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof.drives", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write cases")
    making.add_argument("folder", type=Path)
    making.add_argument("--seed", type=int, required=True)
    making.add_argument("--cases", type=int, required=True)
    making.add_argument("--group", choices=GROUPS, default="")
    scoring = commands.add_parser("score", help="let the tool diagnose them")
    scoring.add_argument("folder", type=Path)
    scoring.add_argument("--out", type=Path, required=True)
    scoring.add_argument("--group", choices=GROUPS, default="")
    scoring.add_argument("--first", type=int, default=0, help="so many of them only (default: all)")
    scoring.add_argument("--limit-seconds", type=float, default=0.0, help="of processor time, a case (default: none)")
    telling = commands.add_parser("table", help="print the figures")
    telling.add_argument("file", type=Path)
    given = parser.parse_args()
    return status_of(lambda: _do(given))


def _do(given: argparse.Namespace) -> None:
    if given.command == "make":
        make(given.folder, given.seed, given.cases, given.group, tell)
    elif given.command == "score":
        from .score import score

        folders = written(given.folder, given.group)
        score(folders[: given.first or None], given.out, given.limit_seconds, tell)
    else:
        from .table import read, table

        tell(table(read(given.file)))
