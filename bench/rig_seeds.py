"""The rig study over many seeds: are friction curves inside their bands, and is what is concealed named?

    python bench/rig_seeds.py [--seeds 20] [--first 1] [--only KIND] [--workers 1]
    python bench/rig_seeds.py --curves [--seeds 40]

With ``--curves`` only friction is identified; what is concealed is not diagnosed. Each seed draws the slides' friction,
the place and size of what is concealed, targets and speeds of the motion, and noise. Every run leaves a line in
``build/bench/rig_seeds.jsonl``; a run that is there already is not made again, so the bench may be stopped and gone on
with. The table counts what the file holds.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model
from snarelab.studies.zero_g_rig.concealed import KINDS
from snarelab.studies.zero_g_rig.recordings import make_recordings, open_answer
from snarelab.studies.zero_g_rig.score import coverage, score, true_curves
from snarelab.studies.zero_g_rig.study import MODEL, friction_study

RESULTS = Path("build/bench/rig_seeds.jsonl")


def run(kind: str, seed: int, only_curves: bool) -> dict[str, Any]:
    """One plant, one friction study, and one diagnosis unless only curves are asked for; one line."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        names = ("train",) if only_curves else ("train", "holdout")
        digest = make_recordings(here, kind, seed, names)
        made = time.process_time()
        model, train, last = load_model(MODEL), here / "train.parquet", here / f"{names[-1]}.parquet"
        friction = friction_study(model, train, last, lambda _: None)
        found = None if only_curves else diagnose(model, [train], last).diagnosis
        truth = open_answer(here, digest)
    line = {
        "kind": kind,
        "seed": seed,
        "truth": truth["effect"],
        "coverage": {c.joint: coverage([c], true_curves(truth, [c])) for c in friction.curves},
        "reduction": friction.train.reduction.tolist(),
        "plant_seconds": made - begun,
        "tool_seconds": time.process_time() - made,
    }
    if found is None:
        return line
    return line | {
        "verdict": found.verdict,
        "score": vars(score(truth, found, friction.curves)),
        "found": [{"name": e.name, "at": e.at, "probability": e.probability} for e in found.effects],
        "rivals": [{"name": r.name, "at": r.at, "separable": r.separable} for e in found.effects for r in e.rivals],
        "holdout": {f.channel: 1.0 - f.holdout.rms_after / f.holdout.rms_before for f in found.fit},
    }


def table(lines: list[dict[str, Any]]) -> str:
    """Counts by kind, and the share of the true friction curves inside the 2σ bands."""
    heads = ("diagnosed", "named", "in class", "at its place", "wrong extra", "seeds", "coverage")
    rows = [f"{'concealed':<22}" + "".join(f"{h:>14}" for h in heads)]
    for kind in KINDS:
        own = {x["seed"]: x for x in lines if x["kind"] == kind}.values()
        if own:
            scores = [x["score"] for x in own if "score" in x]
            counts = [f"{sum(s[key] for s in scores)} / {len(scores)}" for key in ("named", "in_class", "placed")]
            counts.append(f"{sum(s['wrong'] > 0 for s in scores)} / {len(scores)}")
            inside = np.mean([list(x["coverage"].values()) for x in own])
            cells = [str(len(scores)), *counts, str(len(own)), f"{inside:.3f}"]
            rows.append(f"{kind:<22}" + "".join(f"{c:>14}" for c in cells))
    return "\n".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--only", choices=KINDS)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--curves", action="store_true")
    asked = parser.parse_args()
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    lines = [json.loads(x) for x in RESULTS.read_text().splitlines()] if RESULTS.is_file() else []
    have = {(x["kind"], x["seed"]) for x in lines if asked.curves or "score" in x}
    kinds = (asked.only,) if asked.only else KINDS[:1] if asked.curves else KINDS
    wanted = [(k, s) for s in range(asked.first, asked.first + asked.seeds) for k in kinds if (k, s) not in have]
    with ProcessPoolExecutor(asked.workers) as pool:
        for done in as_completed([pool.submit(run, *w, asked.curves) for w in wanted]):
            line = done.result()
            lines.append(line)
            with RESULTS.open("a") as file:
                file.write(json.dumps(line) + "\n")
            names = [f"{e['name']} at {e['at']}" for e in line.get("found", [])] or [line.get("verdict", "curves")]
            print(f"{line['kind']} {line['seed']}: {line['truth']} -> {', '.join(names)}", flush=True)
    print(table(lines))


if __name__ == "__main__":
    main()
