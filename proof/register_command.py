"""``python -m proof register``, ``verify`` and ``registered``, ``rivals``: a proof announced before it was run."""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from .ending import status_of, tell

COMMANDS = ("register", "verify", "registered", "rivals")
GENERATORS = ("drives", "played", "mujoco")


def main(words: Sequence[str]) -> int:
    """Read the arguments and do it."""
    parser = argparse.ArgumentParser(prog="python -m proof", description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    registering = commands.add_parser("register", help="write proof/registered.json, to be committed before the run")
    for name in GENERATORS:
        registering.add_argument(f"--{name}", type=int, nargs="+", default=[], metavar="SEED")
    registering.add_argument("--cases", type=int, default=75, help="of each seed (default: 75)")
    commands.add_parser("verify", help="tell whether the tree is the registered one")
    running = commands.add_parser("registered", help="run what was registered; resumed")
    asking = commands.add_parser("rivals", help="ask the rivals about what the tool has answered; resumed")
    for one in running, asking:
        one.add_argument("--hours", type=float, default=1.0)
        one.add_argument("--only", choices=GENERATORS, help="this generator alone: several can run side by side")
        one.add_argument("--folder", type=Path, default=Path("build/proof/registered"), help="of cases and result.json")
        one.add_argument("--answers", type=Path, default=Path("proof/answers"), help="to be committed")
    given = parser.parse_args(words)
    return status_of(lambda: _do(given))


def _do(given: argparse.Namespace) -> int:
    from . import register

    if given.command == "register":
        seeds = {name: own for name in GENERATORS if (own := getattr(given, name))}
        if not seeds:
            options = " or ".join(f"--{name} SEED..." for name in GENERATORS)
            raise ValueError(f"no seeds: give {options}, none that was looked at before")
        register.write(register.register(seeds, given.cases))
        tell(f"{register.REGISTERED}: commit it, then python -m proof registered")
        return 0
    registered = register.load()
    if given.command == "verify":
        found = register.differences(registered)
        tell(
            "\n".join(found) or f"the tree is the one registered on {registered['date']} at {registered['commit'][:12]}"
        )
        return 1 if found else 0
    from . import left_out, registered_rivals
    from .bars_table import LEFT_OUT, table
    from .registered_quantities import of_rivals, result
    from .seal import write_json

    if given.command == "rivals":
        registered_rivals.ask(registered, given.hours, tell, given.folder, given.answers, only=given.only)
        tell(registered_rivals.printed(registered, registered_rivals.compared(registered, given.answers)))
        return 0
    begun = time.monotonic()
    files = register.run(registered, given.hours, tell, given.folder, given.answers, only=given.only)
    found = register.result(registered, files)
    for name, figure in left_out.of_files(files).items():
        found["generators"][name][LEFT_OUT] = figure
    tell(f"{register.printed(files)}\n\n{table(found)}")
    write_json(given.folder / "result.json", found)
    rivals = of_rivals(registered_rivals.compared(registered, given.answers))
    summary = given.folder.parent / "result.json"
    write_json(summary, result(found, rivals, Path("build/power"), time.monotonic() - begun))
    tell(f"numbers: {summary}, every figure: {given.folder / 'result.json'}")
    return 0
