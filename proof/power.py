"""``python -m proof.power DIR``: how often an effect is seen, and by its right name, around the limit that is stated.

A diagnosis states the smallest value of each effect that the recordings would have shown. Here an arm of the proof's
own generator is recorded with nothing concealed and diagnosed; then one effect is concealed in the same arm, with the
same motions, disturbance and noise, at 0.4 to 2 times the value that was stated for it at its place, and the arm is
diagnosed again. The statement is true where effects at their limit and above are seen in at least nine of ten.

What is done is kept in ``DIR/power.jsonl`` and not done again by the same sources; ``DIR/result.json`` and
``DIR/power.svg`` are made of what is there. Seeds 90000 to 99999 are for work on the tool.
"""

import argparse
import json
import shutil
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from snarelab.files import written_whole

from .cases import Case, planned_case
from .concealed import MAKERS, VALUES
from .judge import joint, judge
from .seal import tool, write_json
from .statistics import clopper_pearson

RATIOS = (0.4, 0.6, 0.8, 1.0, 1.4, 2.0)
NEAR = 0.02
"""How near to its ratio an effect's value must come; makers are not all linear in the torque they are asked for."""
TRIES = 6
"""Secant steps to that value."""
ATTEMPTS = 1000

Line = dict[str, Any]
Diagnose = Callable[[Path], Mapping[str, Any]]


class NoLimit(ValueError):
    """Nothing can be concealed at a multiple of what was stated."""


def base(kind: str, seed: int, number: int, folder: Path) -> tuple[int, Case]:
    """The first attempt at this case that hardware has, and whose arm follows its motions with nothing concealed: the
    case, and that arm's recordings in ``folder``."""
    for attempt in range(ATTEMPTS):
        case = planned_case(("single", (kind,), 1.0), seed, number, attempt)
        try:
            if case is not None:
                _written(replace(case, plant=case.twin, model=case.twin_model), folder)
                return attempt, case
        except NoLimit:
            continue
    raise NoLimit(f"no arm in {ATTEMPTS} attempts")


def stated(case: Case, found: Mapping[str, Any]) -> float:
    """The limit that a diagnosis states for what a case conceals, at its place.

    Raises
    ------
    NoLimit
        It states none for the parameter that the generator draws.
    """
    (truth,) = case.answer.truths
    own = [
        x
        for x in found["limits"]
        if (x["name"], joint(x["at"])) == (truth.name, joint(truth.at)) and x["parameter"] == VALUES.get(truth.name)
    ]
    if found["effects"]:
        raise NoLimit("something was named where nothing was concealed")
    if len(own) != 1:
        raise NoLimit("no limit of its value was stated")
    return abs(float(own[0]["value"]))


def sized(kind: str, seed: int, number: int, attempt: int, value: float) -> Case:
    """The arm of this attempt with an effect of this value; NoLimit where hardware has none, or no size makes it."""
    size, case = 1.0, None
    for _ in range(TRIES):
        case = planned_case(("single", (kind,), size), seed, number, attempt)
        if case is None:
            raise NoLimit("hardware has none so large")
        own = abs(case.answer.value[0])
        if abs(own / value - 1.0) < NEAR:
            return case
        size *= value / own
    raise NoLimit("no size makes this value")


def lines(kind: str, seed: int, number: int, folder: Path, run: Diagnose) -> list[Line]:
    """A line for each ratio; one without a ratio where none can be made."""
    about = {"kind": kind, "seed": seed, "number": number}
    try:
        attempt, case = base(kind, seed, number, folder)
        limit = stated(case, run(folder))
    except NoLimit as error:
        return [about | {"ratio": None, "why": str(error)}]
    found = []
    for ratio in RATIOS:
        line = about | {"ratio": ratio, "limit": limit}
        try:
            case = sized(kind, seed, number, attempt, ratio * limit)
            _written(case, folder)
        except NoLimit as error:
            found.append(line | {"why": str(error)})
            continue
        said = run(folder)
        judged = judge(case.answer, said)
        found.append(
            line
            | {
                "size": case.answer.size,
                "seen": said["verdict"] not in ("adequate", "failed"),
                "named": judged.name and judged.place,
                "said": [list(x) for x in judged.named] or said["verdict"],
            }
        )
    return found


def _written(case: Case, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    try:
        case.write(folder)
    except ValueError as error:
        raise NoLimit(str(error)) from None


def result(every: Sequence[Line]) -> dict[str, Any]:
    """Shares by effect and ratio, with their exact intervals; and what could not be tried, by its reason."""
    found: dict[str, Any] = {"ratios": list(RATIOS), "effects": {}, "untried": {}}
    for kind in (*MAKERS, "all"):
        own = [x for x in every if kind in (x["kind"], "all")]
        rows = []
        for ratio in RATIOS:
            some = [x for x in own if x["ratio"] == ratio and "seen" in x]
            row: Line = {"ratio": ratio, "cases": len(some)}
            for what in ("seen", "named"):
                count = sum(x[what] for x in some)
                row[what] = count / len(some) if some else None
                row[f"{what}_interval"] = list(clopper_pearson(count, len(some)))
            rows.append(row)
        if any(r["cases"] for r in rows):
            found["effects"][kind] = rows
    for x in every:
        if "why" in x:
            key = f"{x['kind']}: {x['why']}"
            found["untried"][key] = found["untried"].get(key, 0) + 1
    return found


def run_on(
    folder: Path,
    seed: int,
    repeats: int,
    run: Diagnose,
    tell: Callable[[str], None] = print,
    end: float = np.inf,
    kinds: Sequence[str] = tuple(MAKERS),
) -> list[Line]:
    """All lines of so many arms an effect, effects in turns; what these sources have done is not done again."""
    folder.mkdir(parents=True, exist_ok=True)
    path, version = folder / "power.jsonl", tool()
    kept = [json.loads(x) for x in path.read_text().splitlines()] if path.exists() else []
    kept = [x for x in kept if x["version"] == version and x["seed"] == seed]
    with written_whole(path) as part:
        part.write_text("".join(json.dumps(x) + "\n" for x in kept), encoding="utf-8")
    done = {(x["kind"], x["number"]) for x in kept}
    with path.open("a", encoding="utf-8") as file:
        for number in range(repeats):
            for kind in kinds:
                if (kind, number) in done:
                    continue
                if time.time() > end:
                    return kept
                new = [x | {"version": version} for x in lines(kind, seed, number, folder / "case", run)]
                kept += new
                file.write("".join(json.dumps(x) + "\n" for x in new))
                file.flush()
                marks = (
                    (x["ratio"], "named" if x["named"] else "seen" if x["seen"] else "-") for x in new if "seen" in x
                )
                seen = " ".join(f"{ratio:g}: {mark}" for ratio, mark in marks)
                tell(f"{number + 1}/{repeats} {kind}: {seen or new[0]['why']}")
    return kept


def main() -> int:
    """Read the arguments, run on, and say what there is."""
    from .pictures import power
    from .run import diagnose

    parser = argparse.ArgumentParser(prog="python -m proof.power", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=90700)
    parser.add_argument("--repeats", type=int, default=8, help="arms an effect (default: 8)")
    parser.add_argument("--hours", type=float, default=np.inf, help="then stop; the same command goes on")
    parser.add_argument("--effects", nargs="+", choices=list(MAKERS), default=list(MAKERS), metavar="EFFECT")
    given = parser.parse_args()

    def tell(words: str) -> None:
        print(words, flush=True)

    try:
        end = time.time() + 3600.0 * given.hours
        every = run_on(given.folder, given.seed, given.repeats, diagnose, tell, end, given.effects)
    except KeyboardInterrupt:
        print("stopped; the same command goes on where it was", file=sys.stderr)
        return 130
    found = result(every)
    write_json(given.folder / "result.json", found)
    if found["effects"]:
        (given.folder / "power.svg").write_bytes(power(found))
    for row in found["effects"].get("all", []):
        shares = [f"{what} {100 * row[what]:.0f} %" for what in ("seen", "named") if row["cases"]]
        tell(f"{row['ratio']:g} times the limit: {', '.join(shares) or 'n/a'} of {row['cases']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
