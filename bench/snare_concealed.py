"""Conceal each effect of a capture in MuJoCo's recordings, and see whether a diagnosis names it.

``python bench/snare_concealed.py --seeds 1 2 --only umbilical_stiffness``. A case is one effect and one seed: two
captures from other start poses by `snare_rods`, with noise, 100 Hz; a model file that has everything else; ``diagnose``
on the first, with the second held out. ``clean`` conceals nothing. Every case done is a line of
``build/snare_concealed.jsonl`` and is not done again; the table is printed at the end.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.snare_rods import Seen, Truth, moved, simulate
from snarelab.identification.snare.diagnose import diagnose_captures
from snarelab.models.model_file import load_model
from snarelab.models.snare.parameters import SnareParameters
from snarelab.models.snare.target import Target

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
EFFECTS = (
    "contact_friction",
    "contact_damping",
    "contact_stiffness",
    "cable_damping",
    "cable_pretension",
    "umbilical_stiffness",
    "hang_point_clearance",
    "clean",
)
KNOWN = {"contact_friction.pin.coefficient": 0.1}
SOFT = 1e6
"""[N/m^1.5] Contacts of a soft pin: on a hard one, nothing that a capture shows depends on their damping."""
POSITION, FORCE, ANGLE, TURN = 1e-4, 0.05, 2e-4, 2e-4
"""Noise of motion capture [m], load cell [N], ring encoder [rad], and of the quaternion."""
RATE = 100.0


def truth_of(effect: str, rng: np.random.Generator) -> tuple[Truth, float, dict[str, float]]:
    """What is in the recording, the size of what is concealed, and what the model file knows."""
    if effect == "contact_friction":
        size = float(rng.uniform(0.1, 0.3))
        return Truth(friction=size), size, {}
    if effect == "contact_damping":
        size = float(10 ** rng.uniform(2.5, 3.0))
        return Truth(penalty=(SOFT, size)), size, KNOWN | {"contact_stiffness.pin.stiffness": SOFT}
    if effect == "contact_stiffness":
        size = float(10 ** rng.uniform(5.5, 6.5))
        return Truth(penalty=(size, 0.0)), size, KNOWN
    if effect == "cable_damping":
        size = float(10 ** rng.uniform(-2.0, -1.4))
        return Truth(cable_damping=size), size, KNOWN
    if effect == "cable_pretension":
        size = float(rng.uniform(300.0, 1000.0))
        return Truth(pretension=size), size, KNOWN
    if effect == "umbilical_stiffness":
        size = float(rng.uniform(40.0, 150.0))
        return Truth(umbilical=size), size, KNOWN
    if effect == "hang_point_clearance":
        size = float(rng.uniform(3e-3, 1e-2))
        return Truth(clearance=size), size, KNOWN
    return Truth(), 0.0, KNOWN


def record(effect: str, seed: int, folder: Path, duration: float = 10.0) -> tuple[Path, list[Path], float]:
    """Write model file and both captures of a case; returns them and the size concealed."""
    rng = np.random.default_rng([seed, EFFECTS.index(effect)])
    truth, size, known = truth_of(effect, rng)
    listed = ", ".join(f'"{key.partition(".")[0]}"' for key in known)
    values = "\n".join(f'"{key}" = {value!r}' for key, value in known.items())
    snare, body = SnareParameters(), Target("spring")
    sizes = f"ring_radius = {snare.ring_radius}\npin_radius = {snare.pin_radius}\nmass = {body.mass}\n"
    model = folder / f"{effect}{seed}.toml"
    model.write_text(
        f'name = "capture"\nsystem = "snare_capture"\neffects = [{listed}]\n[capture]\n{sizes}[parameters]\n{values}\n'
    )
    paths = []
    for role in ("train", "holdout"):
        target = moved(Target("spring"), np.array([0.0, *rng.uniform(-0.012, 0.012, 2)]))
        path = folder / f"{effect}{seed}_{role}.csv"
        paths.append(path)
        if not path.exists():
            write(path, simulate(SnareParameters(), target, truth, duration), target, rng)
    return model, paths, size


def write(path: Path, seen: Seen, target: Target, rng: np.random.Generator) -> None:
    """A recording of what was seen: forces averaged between rows, noise on everything."""
    size = round(1 / RATE / seen.time[0])
    n = len(seen.time) // size
    force = seen.force[: n * size].reshape(n, size, 3).mean(1)
    rows = slice(size - 1, n * size, size)
    columns = {"time": seen.time[rows], "angle.ring": seen.angle[rows] + ANGLE * rng.normal(size=n)}
    for i, axis in enumerate("xyz"):
        columns[f"pos.target.{axis}"] = seen.position[rows, i] + POSITION * rng.normal(size=n)
        columns[f"force.target.{axis}"] = force[:, i] + FORCE * rng.normal(size=n)
    for i, axis in enumerate("wxyz"):
        columns[f"quat.target.{axis}"] = target.orientation[i] + TURN * rng.normal(size=n)
    pd.DataFrame(columns).to_csv(path, index=False)


def run_case(effect: str, seed: int, folder: Path) -> dict[str, Any]:
    """Record and diagnose one case; what is worth knowing of it as plain values."""
    model, (train, holdout), size = record(effect, seed, folder)
    begun, cpu = time.perf_counter(), sum(os.times()[:4])
    found, _ = diagnose_captures(load_model(model), [train], holdout)
    answer = found.to_json()
    ranked = [c["name"] for c in sorted(answer["candidates"], key=lambda c: -c["score"])]
    named = [e["name"] for e in answer["effects"]]
    values = {e["name"]: next(iter(e["parameters"].values()))["value"] for e in answer["effects"]}
    fit = answer["fit"]
    kinds = {
        kind: [
            float(np.sqrt(sum(fit[c]["holdout"][f"rms_{when}"] ** 2 for c in fit if c.startswith(kind))))
            for when in ("before", "after")
        ]
        for kind in ("pos", "force")
    }
    return {
        "effect": effect, "seed": seed, "size": size, "named": named, "found": values.get(effect),
        "rank": ranked.index(effect) + 1 if effect in ranked else None, "verdict": answer["verdict"],
        "merged": [r["name"] for e in answer["effects"] for r in e["rivals"] if not r["separable"]],
        "holdout": kinds, "seconds": time.perf_counter() - begun, "cpu": sum(os.times()[:4]) - cpu,
        "candidates": {c["name"]: [c["score"], c["explained"]] for c in answer["candidates"]},
    }  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """One line a case."""
    lines = [f"{'concealed':<22}{'seed':>5}{'size':>10}{'found':>10}{'rank':>6}  named; held-out motion mm, force N"]
    for r in sorted(rows, key=lambda r: (EFFECTS.index(r["effect"]), r["seed"])):
        found = "–" if r["found"] is None else f"{r['found']:.3g}"
        (p0, p1), (f0, f1) = r["holdout"]["pos"], r["holdout"]["force"]
        lines.append(
            f"{r['effect']:<22}{r['seed']:>5}{r['size']:>10.3g}{found:>10}{r['rank'] or 0:>6}  "
            f"{', '.join(r['named']) or r['verdict']}; {1e3 * p0:.2f} → {1e3 * p1:.2f}, {f0:.2f} → {f1:.2f} "
            f"({r['seconds']:.0f} s)"
        )
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--only", nargs="+", choices=EFFECTS, default=EFFECTS)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "snare_concealed.jsonl")
    parser.add_argument("--keep", type=Path, help="folder for the recordings; made there once")
    parser.add_argument("--record", action="store_true", help="make the recordings only")
    given = parser.parse_args()
    given.out.parent.mkdir(parents=True, exist_ok=True)
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.exists() else []
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for seed in given.seeds:
            for effect in given.only:
                if any((r["effect"], r["seed"]) == (effect, seed) for r in rows):
                    continue
                if given.record:
                    record(effect, seed, folder)
                    continue
                rows.append(run_case(effect, seed, folder))
                with given.out.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
                print(table(rows[-1:]).splitlines()[1], flush=True)
    if rows:
        print(table(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
