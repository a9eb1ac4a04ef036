"""The command line: ``snarelab check | identify | diagnose | simulate | formulate | export | cosim | tolerance | ...``.

Exit status 0: it ran, whatever the verdict. 2: unusable input, one line on standard error, nothing written.
130: interrupted (Ctrl-C, or SIGTERM). 1: a fault of the program.
"""

import argparse
import errno
import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from . import __version__
from .arguments import positive
from .cosim.command import add_parser as add_cosim
from .errors import InputError, nearest, one_line
from .exit_status import status_of
from .fmu.command import add_parser as add_export
from .identification.formulate_command import add_parser as add_formulate
from .progress import Progress, start_logging
from .report.outputs import demand_writable, write_json
from .threads import one_thread
from .tolerance.command import add_parser as add_tolerance

if TYPE_CHECKING:
    from .models.model import Model
    from .report.provenance import Provenance

JOBS = "processes in which captures are simulated (default: one for each core, at most 4); other systems refuse it"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; see the module's text for the exit status."""
    parser = _parser()
    given = parser.parse_args(arguments)
    given.words = list(sys.argv[1:] if arguments is None else arguments)
    start_logging(given.verbose, quiet=getattr(given, "quiet", False))
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _notice
            return status_of(partial(_run, given))
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains once more at its end
        if error.errno == errno.EPIPE:  # whoever reads standard output has closed it, as `head` does
            return 0
        print(
            f"snarelab: {error.filename or 'standard output'}: {error.strerror}; make room and run again",
            file=sys.stderr,
        )
        return 2


def _run(given: argparse.Namespace) -> int:
    given.run(given)
    sys.stdout.flush()
    return 0


class _OneLineParser(argparse.ArgumentParser):
    """Says what is wrong with the arguments in one line; ``--help`` has the rest."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As ever, and remember what was given."""
        self._given = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Exit with status 2; a required option that is missing may be there, but misspelt."""
        known = [option for option in self._option_string_actions if option.startswith("--")]
        for word in (w.partition("=")[0] for w in self._given if w.startswith("--") and "required" in message):
            if not any(option.startswith(word) for option in known):
                message += f"; {word} is not one, did you mean {nearest(word, known)}?"
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def _parser() -> argparse.ArgumentParser:
    parser = _OneLineParser(prog="snarelab", description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    p = commands.add_parser("check", help="see whether recordings can belong to a model")
    p.add_argument("model", metavar="MODEL.toml")
    p.add_argument("recordings", nargs="+", metavar="RECORDING")
    p.add_argument("--json", metavar="OUT.json", help="where to write the result; - for standard output")
    p.set_defaults(run=_check)

    p = commands.add_parser("identify", help="fit every parameter of a model to recordings")
    p.add_argument("model", metavar="MODEL.toml")
    p.add_argument("recordings", nargs="+", metavar="RECORDING")
    p.add_argument(
        "--holdout",
        action="append",
        metavar="RECORDING",
        help="held-out recording: the fit is evaluated on it; may be repeated",
    )
    p.add_argument("--json", metavar="OUT.json", help="where to write the result; - for standard output")
    p.add_argument("--save-model", metavar="NEW.toml", help="where to write the model with its values")
    p.add_argument("--jobs", type=positive, metavar="N", help=JOBS)
    p.set_defaults(run=_identify)

    p = commands.add_parser("diagnose", help="find, name and add the physics that a model leaves out")
    p.add_argument("model", metavar="MODEL.toml")
    p.add_argument("recordings", nargs="+", metavar="RECORDING")
    p.add_argument(
        "--holdout",
        required=True,
        action="append",
        metavar="RECORDING",
        help="held-out recording: it confirms names; may be repeated",
    )
    p.add_argument("--json", metavar="OUT.json", help="where to write the result; - for standard output")
    p.add_argument("--report", metavar="OUT.html", help="where to write the report, one self-contained page")
    p.add_argument("--save-model", metavar="NEW.toml", help="where to write the improved model")
    p.add_argument(
        "--next-experiment",
        metavar="MOTION",
        help="where to write the motion that best separates the remaining rivals (system = 'arm')",
    )
    p.add_argument("--jobs", type=positive, metavar="N", help=JOBS)
    p.add_argument("--anyway", action="store_true", help="name physics even if recordings contradict the model")
    p.set_defaults(run=_diagnose)

    p = commands.add_parser("simulate", help="simulate a model along a recorded motion")
    p.add_argument("model", metavar="MODEL.toml")
    p.add_argument("--motion", metavar="RECORDING", help="recording whose motion is followed; a capture needs none")
    p.add_argument("--out", required=True, metavar="RECORDING", help="where to write it (.csv or .parquet)")
    p.set_defaults(run=_simulate)

    add_formulate(commands)
    add_export(commands)
    add_cosim(commands)
    add_tolerance(commands)
    for command in commands.choices.values():
        command.add_argument(
            "-v", "--verbose", action="count", default=0, help="log steps to standard error; -vv: in detail"
        )
        command.add_argument(
            "-q", "--quiet", action="store_true", help="no progress; check, identify and diagnose: no summary"
        )
    p = commands.add_parser("completion", help="print the script with which a shell completes these commands")
    p.add_argument("shell", choices=("bash", "zsh", "tcsh"))
    p.set_defaults(run=lambda given: _complete(parser, given.shell), verbose=0)
    return parser


def _complete(parser: argparse.ArgumentParser, shell: str) -> None:
    import shtab

    print(shtab.complete(parser, shell))


def _check(given: argparse.Namespace) -> None:
    one_thread()
    from .identification.checks.run import check_file
    from .identification.results import CheckResult

    demand_writable(given.json, [], given.recordings)
    with Progress() as progress:
        result = CheckResult(*check_file(given.model, given.recordings, progress=progress))
    if given.json:
        write_json(result.to_json(), given.json)
    if given.json != "-" and not given.quiet:
        print(result)


def _identify(given: argparse.Namespace) -> None:
    one_thread()
    from .identification.identify import identify  # engines load only for a command that needs them
    from .identification.summary import parameter_table
    from .models.model_file import load_model
    from .models.model_write import save_model

    held = given.holdout or []
    demand_writable(given.json, [given.save_model], [*given.recordings, *held])
    model = load_model(given.model)
    with Progress() as progress:
        found = identify(model, given.recordings, held, progress=progress, jobs=given.jobs)
    result = found.to_json()
    if given.save_model:
        save_model(found.model, given.save_model, f"{model.name}: values from snarelab identify {__version__}")
    if given.json:
        write_json(result, given.json)
    if given.json != "-" and not given.quiet:
        print(parameter_table(result))


def _diagnose(given: argparse.Namespace) -> None:
    one_thread()
    from .identification.diagnose import diagnose
    from .identification.search.next_experiment import next_experiment
    from .identification.summary import printed
    from .models.model_file import load_model
    from .models.model_write import save_model
    from .recordings import demand_suffix, write_recording

    outputs = [given.report, given.save_model, given.next_experiment]
    demand_writable(given.json, outputs, [*given.recordings, *given.holdout])
    model, planned = load_model(given.model), None
    if given.next_experiment:
        demand_suffix(given.next_experiment)
        if model.system != "arm":
            raise InputError(
                f"{given.model}: system = {model.system!r}; a motion is planned for system = 'arm' only, leave "
                "--next-experiment out; the result says for each rival what would part it"
            )
    with Progress() as progress:
        answer = diagnose(
            model, given.recordings, given.holdout, progress=progress, jobs=given.jobs, anyway=given.anyway
        )
        if given.next_experiment and answer.diagnosis.fit:
            planned = next_experiment(answer.model, answer.diagnosis, given.recordings, progress=progress)
    found = answer.diagnosis
    if planned:
        write_recording(planned.motion, given.next_experiment)
    if given.report:
        from .identification.report.page import write_report  # it draws, which takes half a second to load

        write_report(found, given.report, _origin(given, model))
    if given.save_model:
        save_model(answer.model, given.save_model, f"{found.sentence}\nsnarelab diagnose {__version__}")
    if given.json:
        write_json(found.to_json(), given.json)
    if given.json != "-" and not given.quiet:
        print(printed(found))
        if given.next_experiment:
            print(planned.sentence if planned else "Next experiment: no rival is left to part; none was written.")
        if given.report:
            print(f"Report: {given.report}")


def _origin(given: argparse.Namespace, model: "Model") -> "Provenance":
    from .report.provenance import provenance

    recordings = [("Training", recording) for recording in given.recordings]
    held = [("Held-out", recording) for recording in given.holdout]
    files = [("Model", given.model), ("Robot", model.urdf), *recordings, *held]
    return provenance(f"snarelab {shlex.join(given.words)}", files)


def _simulate(given: argparse.Namespace) -> None:
    from .identification.simulate import simulate
    from .models.model_file import load_model
    from .recordings import demand_suffix, write_recording

    demand_writable(None, [given.out], [given.motion])
    demand_suffix(given.out)
    write_recording(simulate(load_model(given.model), given.motion), given.out)


def _notice(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    if issubclass(category, UserWarning):
        line = "\r\x1b[2K" if sys.stderr.isatty() else ""  # what is under way may stand there
        print(f"{line}snarelab: {one_line(message)}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
