"""``snarelab tolerance``: run a study of capture tolerances, or go on with one."""

import argparse
import sys

from ..arguments import positive


def add_parser(commands: argparse._SubParsersAction) -> None:
    """Add the command to the command line."""
    p = commands.add_parser("tolerance", help="find the misalignments with which a capture succeeds")
    p.add_argument("study", metavar="STUDY.toml")
    p.add_argument(
        "--out", required=True, metavar="RESULTS", help="folder of the results; a killed run is resumed from it"
    )
    p.add_argument(
        "--scheduler", metavar="ADDRESS", help="a running Dask scheduler; without it, processes of this machine"
    )
    p.add_argument("--jobs", type=positive, default=2, metavar="N", help="processes of this machine (default 2)")
    p.set_defaults(run=run)


def run(given: argparse.Namespace) -> None:
    """Run it; raises InputError for unusable input."""
    from ..progress import Progress
    from .report import summarise
    from .results import Results
    from .run import demand_scheduler, run_study
    from .study import load_study

    study = load_study(given.study)
    if given.scheduler is not None:
        demand_scheduler(given.scheduler)  # before anything is written
    results = Results(given.out, study)
    try:
        with Progress() as progress:
            run_study(study, results, jobs=given.jobs, scheduler=given.scheduler, say=progress)
            progress("writing the results")
            content = summarise(study, results)
    except KeyboardInterrupt:
        print(f"snarelab: interrupted; {len(results)} cases are kept, the same command resumes it", file=sys.stderr)
        sys.exit(130)
    print(f"{content['sentence']}\nReport: {results.folder / 'report.html'}")
