"""Write cases; one that is there is not made again."""

import argparse
from collections.abc import Callable
from pathlib import Path

from ..drives.make import made
from ..ending import status_of, tell
from .cases import GROUPS, planned, write
from .residuals import RECORDINGS, residuals
from .robots import published


def make(
    folder: Path, seed: int, count: int, group: str = "", tell: Callable[[str], None] = print, first: int = 0
) -> list[Path]:
    """Folders of the first ``count`` cases of a seed from number ``first`` on, or of those among them of one group.

    Raises
    ------
    ValueError
        ``folder`` holds cases of another seed; or the real recordings, or the published arms, are not there.
    """
    if not residuals():
        raise ValueError(f"no recordings in {RECORDINGS}: there is nothing to play")
    if not published():
        raise ValueError("the package example-robot-data is not installed: make .venv/installed does it")
    return made(folder, seed, planned(seed, count), group, tell, write, first)


def main() -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof.played", description="Cases of the third generator.")
    parser.add_argument("command", choices=("make",))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, required=True)
    parser.add_argument("--group", choices=GROUPS, default="")
    given = parser.parse_args()

    def run() -> None:
        make(given.folder, given.seed, given.cases, given.group, tell)

    return status_of(run)
