"""``python -m proof.calibrate``: how often a name is right, counted on cases of other seeds than the proof's.

Cases of the proof's own generator are drawn as the proof's are, from seeds that are for work on the tool, and
diagnosed; what is done is kept under ``build/calibration``. To these come the lines that ``python -m proof.drives
score`` kept. A name is right as ``proof/judge.py`` and ``proof/drives/judge.py`` say: it, or one that the recordings
cannot tell from it, is concealed at its place. The result is the logistic map of names of torques in
``identification/reliability.json`` (`counting`), with how well each generator is predicted by a map that leaves it out;
it is written only where such maps have a smaller Brier score on what they leave out than the map that is stored.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from multiprocessing import get_context
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

from .cases import ROUND
from .counting import RIDGE, Row, brier, counted, generator_of, of_effects, of_lines, skill
from .ending import status_of, tell
from .judge import names_in, rightly_placed
from .run import diagnose, fill, prepare
from .score import score
from .seal import ROOT, tool, write_json

SEED = 90200
FOLDER = Path("build/calibration")
JSON = ROOT / "identification" / "reliability.json"
OWN = "mujoco"
"""The proof's own generator."""


def main() -> int:
    """Record, diagnose, count; print the figures, too, which are those of work on the tool and prove nothing."""
    parser = argparse.ArgumentParser(prog="python -m proof.calibrate", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=len(ROUND), help="of the proof's own generator; 0: none")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument(
        "--drives", type=Path, nargs="*", default=[], help="files of python -m proof.drives score, of either generator"
    )
    given = parser.parse_args()

    def count() -> int:
        cases: dict[str, int] = {}
        rows: list[Row] = []
        for file in given.drives:
            lines = [json.loads(x) for x in file.read_text(encoding="utf-8").splitlines()]
            rows += of_lines(lines)
            for line in lines:
                cases[generator_of(line)] = cases.get(generator_of(line), 0) + 1
        if given.cases:
            rows += own(given.cases, given.seed, given.workers, tell)
            cases[OWN] = given.cases
        before = json.loads(JSON.read_text(encoding="utf-8"))
        stored = mapped(rows, cases, before, sys.argv[1:])
        tell(json.dumps(stored["counted"], indent=1))
        left_out, old = counted(rows).brier, brier(before["logit"], rows)
        tell(f"Brier score of each generator left out: {left_out}; of the map that is stored: {old:.3f}")
        if left_out is not None and left_out >= old:
            tell("no better than the map that is stored, which stays")
            return 1
        write_json(JSON, stored)
        return 0

    return status_of(count, (ValueError, OSError))


def own(cases: int, seed: int, workers: int, tell: Callable[[str], None]) -> list[Row]:
    """Names of cases of the proof's own generator; what was recorded and diagnosed is not done again."""
    folder = FOLDER / str(seed)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        answers, folders, seal = prepare(cases, seed, pool, tell, folder)
        found = fill(folder / "diagnoses.jsonl", tool() + seal.answers, folders, diagnose, pool, tell)
    for figure in score(answers, found).figures.values():
        tell(f"{figure.name:24} {figure.value}")
    rows = []
    for answer, one in zip(answers, found, strict=True):
        rows += of_effects(names_in(one), rightly_placed(answer, one), OWN)
    return rows


def mapped(
    rows: Sequence[Row], cases: dict[str, int], stored: dict[str, Any], arguments: Sequence[str]
) -> dict[str, Any]:
    """What is stored, with the map counted over these rows in place of the one it had."""
    found = counted(rows)
    generators = {}
    for name, count in sorted(cases.items()):
        own = [r for r in rows if r.generator == name]
        right = sum(r.right for r in own)
        before = skill(stored["logit"], own) if own else None
        generators[name] = {"cases": count, "names": len(own), "right": right, "skill": found.skill.get(name)}
        generators[name]["skill_of_the_map_before"] = before
    return stored | {
        "logit": list(found.logit),
        "counted": {
            "generators": generators,
            "ridge": RIDGE,
            "commit": _commit(),
            "date": date.today().isoformat(),
            "command": " ".join(["python -m proof.calibrate", *arguments]),
        },
    }


def _commit() -> str:
    """Of the sources, and whether they had been changed since; empty where there is no repository."""
    asked = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    return asked.stdout.strip() if asked.returncode == 0 else ""


if __name__ == "__main__":
    sys.exit(main())
