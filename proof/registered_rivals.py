"""The rivals on the registered cases: same recordings, same judge, figures side by side.

``python -m proof rivals --hours H`` asks `METHODS` about each registered case that the tool has answered, and keeps
what they said in ``rivals`` beside the tool's answers, a line a case. A rival that breaks down on a case is wrong
there. The Gaussian process of `rivals`, which names nothing, is not asked. Errors on the third recording are below the
rivals' own cutoff, and so is their oracle: what the fit of the baseline leaves of the case's twin.
"""

import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from . import rivals
from .benchmark.case_set import GENERATORS
from .drives.cases import TWIN
from .drives.judge import judge
from .drives.score import alike
from .drives.table import Figure, figures
from .register import ANSWERS, FOLDER, answered
from .seal import ROOT, digest

Line = dict[str, Any]
OWN = "snarelab"
METHODS: dict[str, Callable[[rivals.Task, Path], Mapping[str, Any]]] = {
    "joint_bic": lambda task, _: rivals.joint_bic(task),
    "pysindy": lambda task, _: rivals.pysindy(task),
    "mujoco_sysid": lambda task, case: rivals.mujoco_sysid(task, case / "arm.urdf"),
}
SOURCES = [ROOT / "proof" / f"{name}.py" for name in ("rivals", "rival_columns", "rival_sysid")]


def version() -> str:
    """SHA-256 over the rivals' sources."""
    return digest(SOURCES)


def ask(
    registered: Mapping[str, Any],
    hours: float,
    tell: Callable[[str], None] = print,
    folder: Path = FOLDER,
    answers: Path = ANSWERS,
    clock: Callable[[], float] = time.monotonic,
    only: str | None = None,
) -> None:
    """Ask about the cases that the tool has answered, generators in turns, until the time is over; resumed."""
    end, own = clock() + 3600.0 * hours, version()
    work = [(name, seed) for name, seeds in registered["seeds"].items() for seed in seeds if name == (only or name)]
    told = {w: answered(answers / f"{w[0]}-{w[1]}.jsonl", registered["tool"]) for w in work}
    done = {w: answered(_path(answers, *w), own) for w in work}
    for k in range(registered["cases"]):
        for name, seed in work:
            number = f"{k:04}"
            if number not in told[name, seed] or number in done[name, seed]:
                continue
            if clock() >= end:
                tell("the time is over; the same command goes on where it was")
                return
            (case,) = GENERATORS[name](folder / name / str(seed), seed, k + 1, tell=tell, first=k)
            line = {"case": number, "version": own, **of_case(case)}
            path = _path(answers, name, seed)
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
            said = ", ".join(f"{key} {len(x['effects'])}" for key, x in line["methods"].items())
            tell(f"{name} {seed} {number}: names of {said}; {line['seconds']:.0f} s")


def of_case(case: Path) -> Line:
    """What every rival says of a case, its truth and the seconds that all took."""
    start = time.perf_counter()
    truth = json.loads((case / "truth.json").read_text(encoding="utf-8"))
    try:
        oracle = rivals.Task(case / TWIN).residual_hold if (case / TWIN).exists() else None
        task = rivals.Task(case)
        found = {name: method(task, case) for name, method in METHODS.items()}
    except ValueError as error:  # a recording at fault: no column, or no filter, is any good
        return _line(dict.fromkeys(METHODS, _broken(str(error))), truth, start)
    left = None if oracle is None else np.sqrt(np.mean(oracle**2, axis=0))
    methods = {}
    for name, said in found.items():
        third = {}
        if left is not None:
            third = {c: [*said["third"][c], float(x)] for c, x in zip(said["third"], left, strict=True)}
        kept = [{"parameters": {}, **e} for e in said["effects"]]
        methods[name] = {"verdict": said["verdict"], "effects": kept} | ({"third": third} if third else {})
    return _line(methods, truth, start)


def _broken(why: str) -> Line:
    return {"verdict": "failed", "effects": [], "notes": [why]}


def _line(methods: Line, truth: Line, start: float) -> Line:
    return {"methods": methods, "truth": truth, "seconds": round(time.perf_counter() - start, 1)}


def compared(registered: Mapping[str, Any], answers: Path = ANSWERS) -> dict[str, dict[str, list[Figure]]]:
    """Figures by generator and method over the cases that both the tool and the rivals have answered."""
    found: dict[str, dict[str, list[Figure]]] = {}
    for name, seeds in registered["seeds"].items():
        judged: dict[str, list[Any]] = {}
        for seed in seeds:
            own = _lines(answers / f"{name}-{seed}.jsonl", registered["tool"])
            others = _lines(_path(answers, name, seed), version())
            for case in own.keys() & others.keys():
                truth = own[case]["truth"]
                if not alike(truth, others[case]["truth"]):
                    raise ValueError(f"{name} {seed} {case}: the rivals were asked about another case; ask them anew")
                judged.setdefault(OWN, []).append(judge(own[case]))
                for method, said in others[case]["methods"].items():
                    line = {**said, "case": case, "truth": truth, "seconds": others[case]["seconds"]}
                    judged.setdefault(method, []).append(judge(line))
        found[name] = {method: figures(cases) for method, cases in judged.items()}
    return found


def printed(registered: Mapping[str, Any], found: Mapping[str, Mapping[str, list[Figure]]]) -> str:
    """The figures that have a bar, a table a generator, a column a method."""
    rows = []
    for name, methods in found.items():
        if not methods:
            continue
        rows.append(f"{name:<62}{'n':>5}" + "".join(f"{method:>18}" for method in methods))
        by_name = [{f.name: f for f in own} for own in methods.values()]
        for key in registered["bars"]:
            row = [own[key] for own in by_name]
            rows.append(f"{key:<62}{row[0].count:>5}" + "".join(f"{_value(f):>18}" for f in row))
    return "\n".join(rows) or "no case is answered by both the tool and the rivals"


def _value(figure: Figure) -> str:
    if figure.value is None:
        return "n/a"
    return f"{100.0 * figure.value:.1f} %" if figure.share else f"{figure.value:.3g}"


def _lines(path: Path, of: str) -> dict[str, Line]:
    rows = map(json.loads, path.read_text(encoding="utf-8").splitlines()) if path.exists() else []
    return {x["case"]: x for x in rows if x["version"] == of}


def _path(answers: Path, name: str, seed: int) -> Path:
    return answers / "rivals" / f"{name}-{seed}.jsonl"
