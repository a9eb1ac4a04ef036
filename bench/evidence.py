"""What the one evidence says beside what the diagnosis says today, on recordings whose answer is known.

``python bench/evidence.py FOLDER...``; a folder holds ``arm.toml``, ``train.csv``, ``hold.csv`` and ``truth.json``, as
``python -m proof.drives make`` writes them. One line a case, then the counts. With ``--result FILE.jsonl`` a line is
kept for each case, and what is there is not done again.
"""

import os

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

from snarelab.errors import InputError
from snarelab.identification.diagnose import diagnose
from snarelab.identification.evidence.diagnose import decide
from snarelab.identification.fitting.base_parameters import base_parameters
from snarelab.identification.fitting.experiment import load_experiments, scales, with_silence
from snarelab.models.effects import effects
from snarelab.models.hidden_state import prepare
from snarelab.models.model_file import load_model
from snarelab.models.rigid_body import RigidBody


def by_evidence(folder: Path) -> dict[str, Any]:
    """Verdict and names of the one evidence, and the seconds of this process's time that they took."""
    start = time.process_time()
    prepare(effects().values())
    model = load_model(folder / "arm.toml")
    body = RigidBody(model.tree)
    train = with_silence(load_experiments(model, [folder / "train.csv"], body))
    held = with_silence(load_experiments(model, [folder / "hold.csv"], body, train[0].motion.band))
    base = base_parameters(body) if model.inertia == "free" else None
    found = decide(model, base, scales(train), train, held)
    names = [n.placed.key for n in found.best.names]
    return {"verdict": found.verdict, "names": names, "seconds": round(time.process_time() - start, 1)}


def by_rules(folder: Path) -> dict[str, Any]:
    """The same of the diagnosis."""
    start = time.process_time()
    model = load_model(folder / "arm.toml")
    found = diagnose(model, [folder / "train.csv"], folder / "hold.csv").diagnosis
    names = [f"{e.name}.{e.at}" for e in found.effects]
    return {"verdict": found.verdict, "names": names, "seconds": round(time.process_time() - start, 1)}


def concealed(folder: Path) -> tuple[list[str], list[str]]:
    """What was concealed, and what the plant has besides that is no wrong name; names with places, and names alone."""
    truth = json.loads((folder / "truth.json").read_text())
    own = truth.get("truths", truth.get("effects", []))
    return [f"{e['name']}.{e['at']}" for e in own if e["name"]], list(truth.get("background", []))


def main() -> int:
    """Every folder, both ways."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--result", type=Path)
    given = parser.parse_args()
    kept = given.result.read_text().splitlines() if given.result and given.result.exists() else []
    done = {line["case"]: line for line in map(json.loads, kept)}
    ways = {"rules": by_rules, "evidence": by_evidence}
    for folder in given.folders:
        if str(folder) not in done:
            line: dict[str, Any] = {"case": str(folder)}
            for way, run in ways.items():
                try:
                    line[way] = run(folder)
                except InputError as error:
                    line[way] = {"verdict": f"refused: {error}", "names": [], "seconds": 0.0}
            done[str(folder)] = line
            if given.result:
                with given.result.open("a") as file:
                    file.write(json.dumps(line) + "\n")
        line = done[str(folder)]
        wanted, _ = concealed(folder)
        said = "; ".join(f"{way}: {', '.join(line[way]['names']) or line[way]['verdict']}" for way in ways)
        print(f"{folder}: concealed {', '.join(wanted) or 'nothing named'}; {said}", flush=True)
    for way in ways:
        right = wrong = total = 0
        for folder in given.folders:
            wanted, besides = concealed(folder)
            names = done[str(folder)][way]["names"]
            total, right = total + len(wanted), right + sum(w in names for w in wanted)
            wrong += sum(n not in wanted and n.partition(".")[0] not in besides for n in names)
        seconds = sum(done[str(f)][way]["seconds"] for f in given.folders) / len(given.folders)
        print(f"{way}: {right} of {total} named at their place, {wrong} names besides, {seconds:.1f} s a case")
    return 0


if __name__ == "__main__":
    sys.exit(main())
