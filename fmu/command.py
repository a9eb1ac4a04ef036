"""``snarelab export``: a model file, or a participant by name, as an FMU."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add ``export`` to the command line's commands."""
    p = subparsers.add_parser("export", help="write a model or a participant as an FMU for other tools")
    p.add_argument("model", metavar="MODEL.toml|PARTICIPANT", help="a model file, or the name of a participant")
    p.add_argument("--fmi", required=True, type=int, choices=(2, 3), help="version of FMI")
    p.add_argument("--out", required=True, metavar="X.fmu", help="where to write it")
    p.add_argument("--inverse", action="store_true", help="motion in, torque out, as in snarelab simulate")
    p.add_argument(
        "--integrator",
        choices=("auto", "rk4", "rosenbrock"),
        default="auto",
        help="rk4: explicit, fixed steps; rosenbrock: for sharp friction and stiff springs; auto: by the model's rates",
    )
    p.set_defaults(run=_export)


def _export(given: argparse.Namespace) -> None:
    from .export import export

    stiff = {"auto": None, "rk4": False, "rosenbrock": True}[given.integrator]
    export(given.model, given.fmi, given.out, inverse=given.inverse, stiff=stiff)
    print(f"{given.out}: FMI {given.fmi}.0, {Path(given.out).stat().st_size / 1024:.0f} KiB")
