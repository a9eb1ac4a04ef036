"""``snarelab formulate MODEL.toml``: formulas for what a diagnosis could only tabulate."""

import argparse
from pathlib import Path

from ..errors import InputError


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``formulate`` to the command line's commands."""
    p = subparsers.add_parser("formulate", help="find a formula for the tables of nameless physics")
    p.add_argument("model", metavar="MODEL.toml", help="a model file with [[empirical]], as diagnose saves it")
    p.add_argument("--at", metavar="JOINT", help="use the tables of this joint alone")
    p.add_argument("--json", metavar="OUT.json", help="where to write the result; - for standard output")
    p.add_argument("--out", metavar="EFFECT.py", help="where to write the formula as an effect's file")
    p.set_defaults(run=_formulate)


def _formulate(given: argparse.Namespace) -> None:
    from ..models.model_file import load_model
    from ..report.outputs import demand_writable, write_json
    from .formulate import formulate
    from .formulate_file import write_effect

    demand_writable(given.json, [given.out], [given.model])
    found = formulate(load_model(given.model), given.at)
    if given.out:
        if len(found) > 1:
            told = ", ".join(f"{f.at} over {f.table.words}" for f in found)
            raise InputError(f"{given.model}: {len(found)} tables ({told}); a file holds one: choose with --at")
        write_effect(found[0], Path(given.out))
    if given.json:
        write_json({"formulas": [f.to_json() for f in found]}, given.json)
    if given.json != "-" and not given.quiet:
        print("\n".join(map(str, found)))
