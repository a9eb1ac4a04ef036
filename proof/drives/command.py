"""The second proof: cases of drives simulated with Pinocchio's models, which share nothing with the first ones.

``python -m proof.drives make DIR --seed N --cases K``, from the repository's root.
"""

import argparse
import sys
from pathlib import Path

from .cases import GROUPS
from .make import make


def main() -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof.drives", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="write cases, resuming")
    making.add_argument("folder", type=Path)
    making.add_argument("--seed", type=int, required=True)
    making.add_argument("--cases", type=int, required=True)
    making.add_argument("--group", choices=GROUPS, default="")
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
