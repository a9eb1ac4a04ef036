"""``snarelab cosim SYSTEM.ssp|SYSTEM.toml --out RECORDING``."""

import argparse
import sys
from math import inf
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..progress import Progress, terminated_is_interrupted


def add_parser(commands: Any) -> None:
    """Add the command to the subparsers of ``snarelab``."""
    p = commands.add_parser("cosim", help="run a system of FMUs and other participants together")
    p.add_argument("system", metavar="SYSTEM.ssp|SYSTEM.toml")
    p.add_argument("--out", required=True, metavar="RECORDING", help="where to write the outputs (.csv or .parquet)")
    p.add_argument("--until", type=float, metavar="SECONDS", help="end of the run, in place of the system file's")
    p.add_argument("--step", type=float, metavar="SECONDS", help="macro step, in place of the system file's")
    p.add_argument("--timeout", type=float, default=60.0, metavar="SECONDS", help="longest wait for one step (60)")
    p.add_argument(
        "--same-process",
        action="store_true",
        help="run participants in this process: faster, but if one hangs or crashes, the run's data are lost",
    )
    p.set_defaults(run=run)


def run(given: argparse.Namespace) -> None:
    """Run and write as it goes; a run that fails or is interrupted keeps its recording up to the last good step.

    Raises InputError with what failed, when, and what was kept; SystemExit(130) where it is interrupted.
    """
    from dataclasses import replace

    from ..recordings.write import demand_suffix
    from .journal import Journal
    from .participant import StepError
    from .setup import Hosting, load_setup

    out = Path(given.out)
    demand_suffix(out)
    if not out.parent.is_dir():
        raise InputError(f"{out}: its folder does not exist; make it first")
    if not 0 < given.timeout < inf:
        raise InputError(f"--timeout {given.timeout}: must be positive and finite")
    setup = load_setup(given.system, Hosting(not given.same_process, given.timeout))
    try:
        changes = {"step": given.step, "stop": given.until}
        setup = replace(setup, **{key: value for key, value in changes.items() if value is not None})
        master = _started(given.system, setup)
        span = setup.stop - setup.start
        with Progress() as progress, terminated_is_interrupted(), Journal(master.record, out) as journal:
            report = journal.report(lambda t: progress(f"{t:.3f} s of {setup.stop:.3f} s", (t - setup.start) / span))
            try:
                result = master.run(setup.stop, report)
            except StepError as error:
                if master.time <= setup.start:
                    journal.discard()
                    raise InputError(f"{given.system}: {error}; no step was made, nothing is written") from None
                journal.finish()
                raise InputError(f"{given.system}: {error}; {out} holds the run up to there") from None
            except InputError:  # a time that cannot be run to, or a disk that is full
                if not master.steps:
                    journal.discard()
                raise
            except KeyboardInterrupt:
                journal.finish()
                print(f"snarelab: interrupted at {master.time:.9g} s; {out} holds the run up to there", file=sys.stderr)
                raise SystemExit(130) from None
            journal.finish()
    finally:
        for participant in setup.system.participants.values():
            participant.close()
    print(f"{result.steps} steps, {result.rejected} rejected, to {master.time:.9g} s")
    for name in setup.open:
        print(f"  nothing is connected to {name}: it kept its start value")
    for loop in result.loops:
        print(f"  algebraic loop solved: {loop}")
    for name, joules in result.residual.items():
        print(f"  bond {name}: the coupling made {joules:.3g} J of {result.exchanged[name]:.3g} J exchanged")
    for event in result.log[:20]:
        print(f"  {event}")
    if len(result.log) > 20:
        print(f"  and {len(result.log) - 20} more such steps")


def _started(path: str, setup: Any) -> Any:
    """The master; whatever is wrong is said with the file's name."""
    from .participant import StepError

    try:
        return setup.master()
    except (InputError, StepError) as error:
        raise InputError(f"{path}: {error}") from None
