"""How often a named effect is right: a bank of simulated arms, each with one concealed effect or none.

``python bench/reliability.py --cases 119 --seed 1 --workers 2``, or ``--only 11 28`` for single cases. Every case is a
random arm that MuJoCo moves, with LuGre friction, disturbances and noise; the concealed effect is sized to 0.5 to 4
times the disturbance, in torque that the known friction cannot pose as. Cases done are lines of
``build/reliability/seed<S>.jsonl`` and are not done again.
The result is ``identification/reliability.json``: the frequency of a right name and place against the margin, which
is how often the effect beat its rivals in a bootstrap. It never falls with the margin (isotonic regression: Barlow,
Bartholomew, Bremner and Brunk 1972), and every group of names counts one right and one wrong name more than it saw, so
that no name is ever certain.
"""

import argparse
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from datetime import date
from multiprocessing import get_context
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from bench.arm import random_arm
from bench.concealed import MAKERS, Concealed, Planned
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

ROOT = Path(__file__).resolve().parents[1]
RATE = 200.0  # Hz
TRAIN, HOLDOUT = 18.0, 10.0  # s
SIZES = (0.5, 4.0)  # multiples of the disturbance's RMS
GROUP = 10  # fewest names behind a knot of the curve
JSON = ROOT / "identification" / "reliability.json"


KINDS = (*MAKERS, "", "", "")
"""One round of cases; an empty name conceals nothing."""


def run_case(seed: int, number: int, seconds: float = TRAIN, holdout: float = HOLDOUT) -> dict[str, Any]:
    """Build, record and diagnose one case; all that is worth knowing of it as plain values."""
    start, kind = time.perf_counter(), KINDS[number % len(KINDS)]
    rng = np.random.default_rng([seed, number])
    with tempfile.TemporaryDirectory() as name:
        record, true, diagnosis = _diagnosed(Path(name), kind, rng, seconds, holdout)
    explained = {(c.name, c.at): c.explained for c in diagnosis.candidates}
    named = []
    for e in diagnosis.effects:
        answers = [(e.name, e.at), *((r.name, r.at) for r in e.rivals if not r.separable)]
        named.append(
            {
                "name": e.name,
                "at": e.at,
                "margin": e.margin,
                "right": any(a in true for a in answers),
                "right_name": any(a[0] == t[0] for a in answers for t in true),
                "right_place": any(_joint(a[1]) == _joint(t[1]) for a in answers for t in true),
                "explained": explained.get((e.name, e.at), 0.0),
                "parameters": {k: v.value for k, v in e.parameters.items()},
                "rivals": [asdict(r) | {"experiment": ""} for r in e.rivals],
            }
        )
    if kind:
        outcome = "found" if any(e["right"] for e in named) else "wrong name" if named else "missed"
    else:
        outcome = "quiet" if diagnosis.verdict == "adequate" else "false alarm"
    seconds = round(time.perf_counter() - start, 1)
    return {"case": number, "kind": kind, "outcome": outcome, **record, "named": named, "seconds": seconds}


def _diagnosed(folder: Path, kind: str, rng: np.random.Generator, seconds: float, holdout: float):
    """Record one arm in ``folder`` and diagnose it: (facts, right answers, diagnosis)."""
    while True:
        try:
            plant, hidden, motions, facts = _drawn(kind, rng, seconds, holdout)
            break
        except ValueError:  # an arm too slow for the time it has, or an effect too large for hardware
            continue
    (folder / "arm.urdf").write_text(plant.arm.urdf())
    known = [(e, j) for e in hidden.knows for j in plant.arm.joints if j != hidden.at or e not in hidden.unknown]
    listed = ", ".join(f'{{name = "{e}", at = "{j}"}}' for e, j in known)
    (folder / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = [{listed}]\n')
    write_csv(folder / "train.csv", simulate(plant, motions[0], seconds, RATE, rng))
    write_csv(folder / "hold.csv", simulate(plant, motions[1], holdout, RATE, rng))
    diagnosis = diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis
    true = {(name, hidden.at) for name in (kind, *hidden.unknown)} if kind else set()
    return facts | {"verdict": diagnosis.verdict}, true, diagnosis


def _drawn(kind: str, rng: np.random.Generator, seconds: float, holdout: float):
    """A random plant, what it conceals, its two motions, and the facts worth a record."""
    n, disturbance = int(rng.integers(2, 4)), float(rng.uniform(0.2, 0.4))
    arm, chosen = random_arm(rng, n), int(rng.integers(n))
    motions = fourier_motion(arm, rng, seconds), point_to_point_motion(arm, rng, holdout, slowest=0.3)
    levels = np.sort(rng.uniform(2.0, 8.0, n))[::-1]
    viscous = levels * rng.uniform(0.4, 1.0, n)
    laws = {j: LuGre(level=float(x), viscous=float(v)) for j, x, v in zip(arm.joints, levels, viscous, strict=True)}
    size = float(np.exp(rng.uniform(*np.log(SIZES))))
    hidden = Concealed("", 0.0)
    if kind:
        states = motions[0](np.arange(0.0, seconds, 1 / RATE))
        planned = Planned(arm, chosen, laws[arm.joints[chosen]], *states, 1 / RATE)
        hidden = MAKERS[kind](planned, size * disturbance, rng)
    if hidden.law:
        laws[hidden.at] = hidden.law
    plant = Plant(
        arm,
        friction=laws,
        encoder_step=dict.fromkeys(arm.joints, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(arm.joints, float(rng.uniform(0.05, 0.15))),
        disturbance=dict.fromkeys(arm.joints, Disturbance(disturbance)),
        **hidden.plant,
    )
    facts = {"at": hidden.at, "value": hidden.value, "size": size, "disturbance": disturbance, "joints": n}
    return plant, hidden, motions, facts


def _joint(place: str) -> int:
    """Number of the joint that a place belongs to: joint2, link2 and tau.joint2 are one."""
    return int(re.findall(r"\d+", place)[-1])


def fill(
    path: Path,
    cases: Sequence[int],
    seed: int,
    workers: int,
    run: Callable[[int, int], dict[str, Any]] = run_case,
    tell: Callable[[str], None] = print,
) -> list[dict[str, Any]]:
    """Do those of the cases that ``path`` does not have yet; all of them, in order."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text().splitlines(keepends=True) if path.exists() else []
    lines = [line for line in lines if line.endswith("\n")]  # a run that was stopped may have left half a line
    path.write_text("".join(lines))
    done = {record["case"]: record for record in map(json.loads, lines)}
    wanted = [k for k in cases if k not in done]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool, path.open("a") as file:
        jobs = [pool.submit(run, seed, k) for k in wanted]
        for job in as_completed(jobs):
            record = job.result()
            done[record["case"]] = record
            file.write(json.dumps(record) + "\n")
            file.flush()
            answers = ", ".join(f"{e['name']} at {e['at']} ({e['margin']:.2f})" for e in record["named"])
            hidden = f"{record['kind'] or 'nothing'} {record['at']}"
            tell(f"{len(done)}/{len(cases)}  case {record['case']}: {hidden}: {record['outcome']}: {answers or '-'}")
    return [done[k] for k in cases]


def curve(margins: ArrayLike, right: ArrayLike, group: int = GROUP) -> tuple[NDArray, NDArray]:
    """Knots (n_knots,) of margin, rising, and of probability, never falling.

    Names are grouped by margin, equal margins together and at least ``group`` at a time (all of them, if fewer).
    """
    order = np.argsort(margins)
    x, y = np.asarray(margins, float)[order], np.asarray(right, float)[order]
    starts = [0]
    for k in range(1, len(x)):
        if x[k] > x[k - 1] and k - starts[-1] >= group and len(x) - k >= group:
            starts.append(k)
    count = np.diff([*starts, len(x)])
    knots = np.add.reduceat(x, starts) / count
    smoothed = (np.add.reduceat(y, starts) + 1.0) / (count + 2.0)
    return knots, isotonic_regression(smoothed, weights=count + 2.0).x


def summary(records: Sequence[dict]) -> str:
    """Rates over the bank, and a line an effect."""
    clean = [r for r in records if not r["kind"]]
    hidden = [r for r in records if r["kind"]]
    named = [e for r in records for e in r["named"]]

    def share(part: int, whole: int) -> str:
        return f"{part}/{whole} ({part / whole:.0%})" if whole else "-"

    lines = [
        f"false alarms on clean cases  {share(sum(r['outcome'] == 'false alarm' for r in clean), len(clean))}",
        f"concealed effects found      {share(sum(r['outcome'] == 'found' for r in hidden), len(hidden))}",
        *(
            f"names: {key.replace('_', ' '):12}          {share(sum(e[key] for e in named), len(named))}"
            for key in ("right", "right_name", "right_place")
        ),
        f"{'concealed':30}{'cases':>6}{'found':>7}{'missed':>8}{'wrong':>7}{'other names':>13}",
    ]
    for kind in dict.fromkeys(KINDS):
        own = [r for r in records if r["kind"] == kind]
        count = [sum(r["outcome"] == x for r in own) for x in ("found", "missed", "wrong name")]
        other = sum(not e["right"] for r in own for e in r["named"])
        lines.append(f"{kind or 'nothing':30}{len(own):6}{count[0]:7}{count[1]:8}{count[2]:7}{other:13}")
    return "\n".join(lines)


def main() -> int:
    """Fill the bank, fit the curve, write and print."""
    parser = argparse.ArgumentParser(description="How often a named effect is right, on a bank of simulated arms.")
    parser.add_argument("--cases", type=int, default=119)
    parser.add_argument("--only", type=int, nargs="+", metavar="CASE", help="do just these, afresh, and make no curve")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    folder = ROOT / "build" / "reliability"
    if given.only:
        with tempfile.TemporaryDirectory() as scratch:
            print(summary(fill(Path(scratch) / "only.jsonl", given.only, given.seed, given.workers)))
        return 0
    records = fill(folder / f"seed{given.seed}.jsonl", range(given.cases), given.seed, given.workers)
    named = [e for r in records for e in r["named"]]
    print(summary(records))
    if not named:
        print("no effect was named: no curve; ask for more --cases", file=sys.stderr)
        return 1
    knots, probability = curve([e["margin"] for e in named], [e["right"] for e in named])
    result = {
        "margin": knots.tolist(),
        "probability": probability.tolist(),
        "names": len(named),
        "cases": given.cases,
        "seed": given.seed,
        "date": date.today().isoformat(),
        "command": f"python bench/reliability.py --cases {given.cases} --seed {given.seed}",
    }
    JSON.write_text(json.dumps(result, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
