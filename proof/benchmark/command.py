"""``python -m proof export DIR``, ``answer DIR`` and ``score DIR ANSWERS.json``: a benchmark for any tool."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..ending import status_of, tell

COMMANDS = ("export", "answer", "score")


def main(words: Sequence[str]) -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    exporting = commands.add_parser("export", help="write cases without answers, and the rules")
    exporting.add_argument("folder", type=Path, metavar="DIR")
    exporting.add_argument("--seed", type=int, required=True)
    exporting.add_argument("--cases", type=int, default=150)
    exporting.add_argument("--generator", choices=("drives", "played", "mujoco"), default="drives")
    answering = commands.add_parser("answer", help="worked examples: answer them with a method that is here")
    answering.add_argument("folder", type=Path, metavar="DIR")
    answering.add_argument("--method", choices=("snarelab", "joint_bic", "mujoco_sysid"), required=True)
    answering.add_argument("--out", type=Path, required=True, metavar="ANSWERS.json")
    scoring = commands.add_parser("score", help="the figures of any tool's answers")
    scoring.add_argument("folder", type=Path, metavar="DIR")
    scoring.add_argument("answers", type=Path, metavar="ANSWERS.json")
    given = parser.parse_args(words)
    return status_of(lambda: _do(given))


def _do(given: argparse.Namespace) -> None:
    from .case_set import CaseSet, export

    cases = CaseSet(given.folder)
    if given.command == "export":
        export(given.folder, given.seed, given.cases, tell, given.generator)
    elif given.command == "answer":
        from .methods import answer

        answer(cases, given.method, given.out, tell)
    else:
        from .score import score

        tool, figures = score(cases, given.answers)
        tell("\n".join([f"{tool}, {len(cases.names())} cases", *map(str, figures)]))
