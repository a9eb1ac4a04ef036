"""Registered runs: what is run, on which seeds and by which tool is committed before it is run.

``registered.json`` beside this file holds the digests of the tool's and of the generators' sources, the seeds, the
number of cases of each generator, and the bars. ``python -m proof register`` writes it, ``verify`` tells whether the
tree is still the registered one, and ``registered --hours H`` runs on for so long, from where it was. Answers are kept
in `ANSWERS`, to be committed as well: a run goes on on another machine, and they show what the figures were counted on.
"""

import json
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from .benchmark.case_set import GENERATORS
from .drives.score import score, sources
from .drives.table import figures, read, table
from .seal import CASES, ROOT, digest, write_json

REGISTERED = Path(__file__).with_name("registered.json")
FOLDER = Path("build/proof/registered")
ANSWERS = Path("proof/answers")
LONGEST = 300.0  # s of processor time, then a diagnosis counts as none

BARS = {
    "clean: a false name": [0.02, "at most"],
    "single 0.5x: its name at its place": [0.75, "at least"],
    "single 1x: its name at its place": [0.90, "at least"],
    "single 2x and above: its name at its place": [0.95, "at least"],
    "place right, of names that are told": [0.95, "at least"],
    "pairs: both told, and nothing wrong besides": [0.85, "at least"],
    "three and four at once: all told, and nothing wrong besides": [0.75, "at least"],
    "laws without a name 2x and above: told as unknown": [0.90, "at least"],
    "faulty recordings: told as a fault of the data": [0.90, "at least"],
    "a parameter or a sensor is wrong: physics not blamed": [0.90, "at least"],
    "single, told rightly: closure on the third recording, median": [0.9, "at least"],
    "single, told rightly: closure on the third recording, worst": [0.6, "at least"],
    "calibration error of names told": [0.05, "at most"],
    "true values of right names within two deviations": [0.90, "at least"],
}
"""Of each generator."""


SHARED = {"mujoco": CASES}
"""Sources of a generator beside its own folder."""


def code(generator: str) -> str:
    """SHA-256 over a generator's sources."""
    return digest([*sorted((ROOT / "proof" / generator).rglob("*.py")), *SHARED.get(generator, ())])


def now() -> dict[str, Any]:
    """What the tree is."""
    return {"tool": sources(), "generators": {name: code(name) for name in GENERATORS}, "bars": BARS}


def register(seeds: Mapping[str, Sequence[int]], cases: int, *, today: str = "", commit: str = "") -> dict[str, Any]:
    """What is to be run, as it is committed.

    Parameters
    ----------
    seeds : mapping of str to sequence of int
        Of each generator; none that was looked at before.
    cases : int
        Of each seed.
    today, commit : str
        By default today, and the commit that is checked out.

    Raises
    ------
    ValueError
        A generator or number that is none, or sources that are not committed.
    """
    for name, own in seeds.items():
        if name not in GENERATORS:
            raise ValueError(f"{name!r} is no generator; there are {', '.join(GENERATORS)}")
        if not own or any(seed < 100 for seed in own):
            raise ValueError(
                f"seeds {list(own)} of {name}: give some from 100 on; those below are for work on the tool"
            )
    if cases < 1:
        raise ValueError(f"{cases} cases a seed: give 1 or more")
    if not commit:
        changed = _git("status", "--porcelain", "identification", "models", "recordings", "checks", "proof")
        if changed:
            raise ValueError(f"commit first, then register: {changed.splitlines()[0].strip()} is not committed")
        commit = _git("rev-parse", "HEAD")
    about = {"date": today or date.today().isoformat(), "commit": commit, "cases": cases}
    return about | {"seeds": {name: list(own) for name, own in seeds.items()}} | now()


def differences(registered: Mapping[str, Any]) -> list[str]:
    """What of the tree is not as it was registered, a line each."""
    tree, found = now(), []
    if tree["tool"] != registered["tool"]:
        found.append(f"the tool's sources are not those registered at {registered['commit'][:12]}")
    for name, own in registered["generators"].items():
        if tree["generators"].get(name) != own:
            found.append(f"the sources of the generator {name} are not those registered")
    if json.loads(json.dumps(tree["bars"])) != registered["bars"]:
        found.append("the bars are not those registered")
    return found


def load() -> dict[str, Any]:
    """What was registered last; raises ValueError where nothing was."""
    if not REGISTERED.exists():
        raise ValueError(f"{REGISTERED} is not there: nothing was registered; python -m proof register --help")
    return json.loads(REGISTERED.read_text(encoding="utf-8"))


def run(
    registered: Mapping[str, Any],
    hours: float,
    tell: Callable[[str], None] = print,
    folder: Path = FOLDER,
    answers: Path = ANSWERS,
    clock: Callable[[], float] = time.monotonic,
    only: str | None = None,
) -> dict[str, Path]:
    """Draw and diagnose what was registered, generators in turns, until the time is over; the answers' files.

    Cases are drawn in ``folder``, with a file of all answers a generator; those of each seed are in ``answers``. With
    ``only``, one generator's alone.

    Raises
    ------
    ValueError
        The tree is not the registered one.
    """
    wrong = differences(registered)
    if wrong:
        raise ValueError("; ".join(wrong))
    end = clock() + 3600.0 * hours
    seeds = {name: own for name, own in registered["seeds"].items() if name == (only or name)}
    work = [(name, seed) for name, own in seeds.items() for seed in own]
    done = {(name, seed): answered(answers / f"{name}-{seed}.jsonl", registered["tool"]) for name, seed in work}
    files = {name: folder / f"{name}.jsonl" for name in seeds}
    order = [(name, seed, k) for k in range(registered["cases"]) for name, seed in work]
    for name, seed, k in order:
        if f"{k:04}" in done[name, seed]:
            continue
        if clock() >= end:
            tell("the time is over; the same command goes on where it was")
            break
        case = GENERATORS[name](folder / name / str(seed), seed, k + 1, tell=tell, first=k)
        score(case, answers / f"{name}-{seed}.jsonl", LONGEST, tell)
    for name, own in seeds.items():
        parts = [answers / f"{name}-{seed}.jsonl" for seed in own]
        files[name].write_text("".join(p.read_text(encoding="utf-8") for p in parts if p.exists()), encoding="utf-8")
    return files


def answered(path: Path, tool: str) -> set[str]:
    """Numbers of the cases that a tool has answered; they are not drawn again."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return {x["case"] for x in map(json.loads, lines) if x["version"] == tool}


def result(registered: Mapping[str, Any], files: Mapping[str, Path]) -> dict[str, Any]:
    """Figures of each generator beside their bars."""
    found: dict[str, Any] = {"registered": dict(registered), "generators": {}}
    for name, path in files.items():
        rows = {f.name: f for f in figures(read(path))}
        found["generators"][name] = {
            key: {"value": f.value, "cases": f.count, "interval": f.interval, **_bar(registered, key, f.value)}
            for key, f in rows.items()
        }
    return found


def _bar(registered: Mapping[str, Any], key: str, value: float | None) -> dict[str, Any]:
    if key not in registered["bars"]:
        return {}
    bar, way = registered["bars"][key]
    met = None if value is None else value <= bar if way == "at most" else value >= bar
    return {"bar": bar, "way": way, "met": met}


def printed(files: Mapping[str, Path]) -> str:
    """Tables of all generators."""
    return "\n\n".join(f"{name}\n{table(read(path))}" for name, path in files.items())


def write(registered: Mapping[str, Any]) -> None:
    """Into the file that is committed."""
    write_json(REGISTERED, dict(registered))


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        raise ValueError(f"git {words[0]} failed: {done.stderr.strip()}")
    return done.stdout.strip()
