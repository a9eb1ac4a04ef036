"""Conceal each effect of a capture in MuJoCo's recordings, and see whether a diagnosis names it.

``python bench/snare_concealed.py --seeds 1 2 --only umbilical_stiffness``. A case is one effect and one seed: two
captures from other start poses by `snare_rods`, with noise, 100 Hz; a model file that has everything else; ``diagnose``
on the first, with the second held out. ``clean`` conceals nothing. Every case done is a line of
``build/snare_concealed.jsonl`` and is not done again; the table is printed at the end.
"""

import os
import sys
import time
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bench.concealing import main
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
        "right": named == [effect] or (effect == "clean" and not named),
        "merged": [r["name"] for e in answer["effects"] for r in e["rivals"] if not r["separable"]],
        "holdout": kinds, "seconds": time.perf_counter() - begun, "cpu": sum(os.times()[:4]) - cpu,
        "candidates": {c["name"]: [c["score"], c["explained"]] for c in answer["candidates"]},
    }  # fmt: skip


def line(row: dict[str, Any]) -> str:
    """A case in words: concealed, found, its rank, what was named, and held-out motion [mm] and force [N]."""
    found = "–" if row["found"] is None else f"{row['found']:.3g}"
    (p0, p1), (f0, f1) = row["holdout"]["pos"], row["holdout"]["force"]
    return (
        f"{'ok ' if row['right'] else 'BAD'} {row['effect']:<22}{row['seed']:>5}{row['size']:>10.3g}{found:>10}"
        f"{row['rank'] or 0:>6}  {', '.join(row['named']) or row['verdict']}; {1e3 * p0:.2f} → {1e3 * p1:.2f} mm, "
        f"{f0:.2f} → {f1:.2f} N ({row['seconds']:.0f} s)"
    )


if __name__ == "__main__":
    sys.exit(main(__doc__ or "", EFFECTS, run_case, record, line, ROOT / "build" / "snare_concealed.jsonl"))
