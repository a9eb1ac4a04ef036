"""The page of commands, written from the program's own parser; `make_pages.py` puts it in its place."""

import argparse

from snarelab.cli import _parser

HEAD = """\
# Commands

`python docs/make_pages.py` writes this page from the program: it has the text of `snarelab COMMAND --help`.

Progress is shown on a terminal only; in a pipe the commands are quiet. The commands are also [Python](python.md) calls.

"""

ABOUT = {
    "identify": """\
Fits every parameter of the model to all recordings jointly, and prints the parameters with their standard deviations
and the misfit of every channel: [results](results.md#identification-json).""",
    "diagnose": """\
Finds, names and adds the physics that the model leaves out, and confirms it on the held-out recording, which may not be
one of the training recordings. It prints the verdict and the table of steps: [results](results.md#diagnosis-json). How
to start with a robot of your own: [guide](own-robot.md).""",
    "simulate": """\
Writes the model's prediction. For an arm it is the torque of every joint along the motion of a recording, on a floating
base the base's own motion too. For a capture it is the target's motion, the forces and the ring's angle. The model file
must have the values of all parameters: use a file that `identify` or `diagnose` saved.""",
    "export": "Writes an FMU for co-simulation: [FMUs](fmu.md).",
    "cosim": """\
Runs a system of FMUs and other participants: [co-simulation](cosimulation.md). A run that fails (status 2) or is
interrupted (130) keeps its recording up to the last good step.""",
    "tolerance": """\
Finds the misalignments with which a capture succeeds: [tolerances](tolerance.md). An interrupted or killed run keeps
every finished case; the same command resumes it.""",
}
"""What a command does beyond the line that its help gives."""

TAIL = """\
## Exit status

| status | meaning |
| --- | --- |
| 0 | It ran, whatever the verdict. |
| 1 | A fault of the program. |
| 2 | Unusable input, a wrong command line, or no room to write. |
| 130 | Interrupted: Ctrl-C, or SIGTERM. |

For unusable input, one line on standard error names the file, the column or row, what is wrong, and the mend. Whatever
the status, an output file that exists is whole. A second run of `cosim` starts again from the beginning.
"""


def page() -> str:
    """The whole page."""
    (commands,) = [a for a in _parser()._actions if isinstance(a, argparse._SubParsersAction)]
    helps = {choice.dest: choice.help or "" for choice in commands._choices_actions}
    parsers = commands.choices
    common = set.intersection(*({_name(a) for a in _shown(p)} for p in parsers.values()))
    parts = [HEAD, "```text\n", *(f"{_usage(parser, common)}\n" for parser in parsers.values()), "```\n"]
    for name, parser in parsers.items():
        summary = helps[name][:1].upper() + helps[name][1:]
        own = [a for a in _shown(parser) if _name(a) not in common]
        parts.append(f"\n## {name}\n\n{ABOUT.get(name, f'{summary}.')}\n\n{_table(own)}")
    if common:
        shared = [a for a in _shown(next(iter(parsers.values()))) if _name(a) in common]
        parts.append(f"\n## Every command\n\n{_table(shared)}")
    return "".join(parts) + "\n" + TAIL


def _shown(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    return [a for a in parser._actions if not isinstance(a, argparse._HelpAction) and a.help != argparse.SUPPRESS]


def _usage(parser: argparse.ArgumentParser, common: set[str]) -> str:
    """One line: what must be given, then what may be in brackets; the same for every version of Python."""
    words = [parser.prog]
    own = [a for a in _shown(parser) if _name(a) not in common]
    for action in sorted(own, key=lambda a: (bool(a.option_strings), not a.required)):
        text = _name(action)
        words.append(text if action.required or not action.option_strings else f"[{text}]")
    return " ".join(words)


def _name(action: argparse.Action) -> str:
    """An argument as it is typed: ``RECORDING...``, ``--fmi 2|3``, ``--inverse``."""
    value = str(action.metavar or "|".join(map(str, action.choices or ())) or action.dest.upper())
    value += "..." if action.nargs == "+" else ""
    if not action.option_strings:
        return value
    return action.option_strings[-1] + ("" if action.nargs == 0 else f" {value}")


def _table(actions: list[argparse.Action]) -> str:
    """What each argument means; those that say nothing of themselves stand in the usage only."""
    rows = ["| argument | meaning |", "| --- | --- |"]
    for action in actions:
        said = (action.help or "").replace("%(default)s", str(action.default)).replace("|", "\\|")
        rows += [f"| `{_name(action).replace('|', chr(92) + '|')}` | {said} |"] if said else []
    return "\n".join(rows) + "\n"
