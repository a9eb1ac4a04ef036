"""Conceal each effect of a docking in MuJoCo's recordings, and see whether a diagnosis names it, alone.

``python bench/docking_concealed.py --seeds 1 2 --only latch_play``. A case is one effect and one seed: two docking
tests from other poses, with other speeds, by `docking_mujoco`, with noise, 200 Hz; a model file that has everything
else; ``diagnose`` on the first, with the second held out. ``clean`` conceals nothing. Every case done is a line of
``build/docking_concealed.jsonl`` and is not done again; the table is printed at the end.
"""

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench.concealing import main
from bench.docking_mujoco import Seen, Truth, simulate
from snarelab.identification.docking.diagnose import diagnose_dockings
from snarelab.models.model_file import load_model

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
KNOWN = {
    "carriage_friction.carriage.level": 20.0,
    "carriage_friction.carriage.viscous": 200.0,
    "docking_friction.grooves.coefficient": 0.15,
}
SETUP = "[docking]\nrestitution = 0.8\nbreakaway = 1e-6\n"
"""MuJoCo's contacts are damped by a linear law, steel on steel, and do not give way before they slide."""
HELD = 1e5
"""See `Truth.held`: a seat's friction does not creep, as steel's does not."""
EFFECTS = ("carriage_friction", "docking_friction", "groove_misalignment", "latch_play", "preload_loss", "clean")
PLACE, TURN, TRAVEL, FORCE, TORQUE, MOTOR, PULL = 1e-5, 3e-5, 1e-6, 0.3, 0.05, 2.0, 5.0
"""Noise of the pose [m, quaternion], the carriage's encoder [m], the target's load cell [N, N·m], the motor's force by
its current [N], and the latches' strain gauges [N]."""
RATE, STEP = 200.0, 2.5e-4
HOLD = 8.0
"""How long the preload is held once the latches close [s]: while nothing moves a fading preload shows alone."""
_SMOOTH = 0.1


def truth_of(effect: str, rng: np.random.Generator) -> tuple[Truth, dict[str, float], str]:
    """What is in the recording, its size and place, by the names of the vocabulary."""
    if effect == "carriage_friction":
        dry, viscous = float(rng.uniform(30.0, 120.0)), float(rng.uniform(0.0, 1000.0))
        return Truth(dry=dry, viscous=viscous), {"level": dry, "viscous": viscous}, "carriage"
    if effect == "docking_friction":
        size = float(rng.uniform(0.1, 0.25))
        return Truth(friction=size), {"coefficient": size}, "grooves"
    if effect == "groove_misalignment":
        groove, size = int(rng.integers(3)), float(rng.uniform(1e-4, 4e-4) * rng.choice([-1, 1]))
        offsets = [0.0, 0.0, 0.0]
        offsets[groove] = size
        return Truth(offsets=(offsets[0], offsets[1], offsets[2])), {"offset": size}, f"groove{groove + 1}"
    if effect == "latch_play":
        size = float(10 ** rng.uniform(-4.0, -3.0))
        return Truth(play=size), {"play": size}, "latches"
    if effect == "preload_loss":
        share, fades = float(rng.uniform(0.3, 0.8)), float(10 ** rng.uniform(0.0, 1.2))
        return Truth(lost=share, lost_time=fades), {"share": share, "time": fades}, "latches"
    return Truth(), {}, ""


def program(rng: np.random.Generator) -> tuple[Callable[[float], float], float, tuple[float, float]]:
    """Travel of a docking test by time [m], its length [s], and when its latches close [s]: out to the knob, along
    until it sits, preload, latch, hold, unload, and twice pushed off against the latches."""
    pull, seat, off = rng.uniform(10, 14) * 1e-3, rng.uniform(4, 6) * 1e-3, rng.uniform(0.6, 1.0) * 1e-3
    preload, deep = 0.0573 + rng.uniform(0, 8e-4), 0.0183 + rng.uniform(0, 2e-4)
    legs = [(0.4, 0.004), (0.020 / pull, 0.024), (0.021 / seat, 0.045), (0.0123 / 5e-3, preload), (0.6, preload)]
    latch = sum(d for d, _ in legs)
    wait = rng.uniform(1.0, 3.0)
    legs += [(HOLD, preload), (2.6, 0.0215), ((0.0215 - deep) / off, deep), (0.3, deep), (0.6, 0.0215), (wait, 0.0215)]
    legs += [((0.0215 - deep) / off, deep), (0.3, deep), (0.6, 0.0215), (0.3, 0.0215)]
    knots = np.concatenate([[0.0], np.cumsum([d for d, _ in legs])])
    fine = np.arange(-2 * _SMOOTH, knots[-1] + 2 * _SMOOTH, 1e-3)
    raw = np.interp(fine, knots, [0.004, *(x for _, x in legs)])
    width = round(_SMOOTH / 1e-3)
    smooth = np.convolve(np.pad(raw, width, mode="edge"), np.full(2 * width + 1, 1 / (2 * width + 1)), "valid")
    first, step = float(fine[0]), 1e-3

    def travel(now: float) -> float:
        place = (now - first) / step
        k = int(place)
        return float(smooth[k] + (place - k) * (smooth[k + 1] - smooth[k]))

    return travel, float(knots[-1]), (latch + 0.1, latch + 1.4)


def record(effect: str, seed: int, folder: Path, truth: Truth | None = None) -> tuple[Path, list[Path], dict[str, Any]]:
    """Write model file and both recordings of a case; returns them and what is concealed."""
    rng = np.random.default_rng([seed, EFFECTS.index(effect)])
    drawn, sizes, place = truth_of(effect, rng)
    known = {key: value for key, value in KNOWN.items() if not key.startswith(effect)}
    listed = ", ".join(f'"{name}"' for name in dict.fromkeys(key.partition(".")[0] for key in known))
    values = "\n".join(f'"{key}" = {value!r}' for key, value in known.items())
    model = folder / f"{effect}{seed}.toml"
    model.write_text(f'name = "docking"\nsystem = "docking"\neffects = [{listed}]\n{SETUP}[parameters]\n{values}\n')
    paths = []
    for role in ("train", "holdout"):
        travel, duration, latch = program(rng)
        off = np.array([-0.1, *rng.uniform(-0.005, 0.005, 2)])
        turn = Rotation.from_rotvec(np.deg2rad(rng.uniform(-1.0, 1.0, 3)))
        path = folder / f"{effect}{seed}_{role}.csv"
        paths.append(path)
        if not path.exists():
            seen = simulate(replace(truth or drawn, held=HELD), travel, duration, off, turn, latch, STEP)
            write(path, seen, rng)
    return model, paths, {"at": place, **sizes}


def write(path: Path, seen: Seen, rng: np.random.Generator) -> None:
    """A recording of what was seen: forces averaged between rows, noise on everything."""
    time = np.array(seen.time)
    size = max(round(1 / RATE / (time[1] - time[0])), 1)
    n = len(time) // size
    rows = slice(size - 1, n * size, size)

    def means(values: list[Any], noise: float) -> Array:
        whole = np.asarray(values, float)[: n * size].reshape(n, size, -1).mean(1)
        return whole + noise * rng.normal(size=whole.shape)

    def samples(values: list[Any], noise: float) -> Array:
        whole = np.asarray(values, float)[rows].reshape(n, -1)
        return whole + noise * rng.normal(size=whole.shape)

    columns: dict[str, Array] = {"time": time[rows], "q.carriage [m]": samples(seen.travel, TRAVEL)[:, 0]}
    columns["tau.carriage [N]"] = means(seen.motor, MOTOR)[:, 0]
    columns["closed.latches"] = np.asarray(seen.closed, float)[rows]
    for name, axes, values in (
        ("pos.effector", "xyz", samples(seen.place, PLACE)),
        ("quat.effector", "wxyz", samples(seen.quaternion, TURN)),
        ("force.target", "xyz", means(seen.force, FORCE)),
        ("torque.target", "xyz", means(seen.torque, TORQUE)),
    ):
        columns |= {f"{name}.{a}": values[:, i] for i, a in enumerate(axes)}
    pulls = means(seen.pull, PULL)
    columns |= {f"tension.latch{i + 1}": pulls[:, i] for i in range(3)}
    pd.DataFrame(columns).to_csv(path, index=False)


def run_case(effect: str, seed: int, folder: Path) -> dict[str, Any]:
    """Record and diagnose one case; what is worth knowing of it as plain values."""
    model, (train, holdout), truth = record(effect, seed, folder)
    begun, cpu = time.perf_counter(), sum(os.times()[:4])
    found, _ = diagnose_dockings(load_model(model), [train], holdout)
    answer = found.to_json()
    named = [f"{e['name']}@{e['at']}" for e in answer["effects"]]
    values = {e["name"]: {k: v["value"] for k, v in e["parameters"].items()} for e in answer["effects"]}
    worst = max(answer["fit"].items(), key=lambda c: c[1]["holdout"]["relative_before"])
    right = named == ([f"{effect}@{truth['at']}"] if effect != "clean" else [])
    return {
        "effect": effect, "seed": seed, "truth": truth, "named": named, "right": right, "verdict": answer["verdict"],
        "found": values.get(effect), "probability": [e["probability"] for e in answer["effects"]],
        "channel": worst[0], "holdout": [worst[1]["holdout"][k] for k in ("rms_before", "rms_after")],
        "seconds": time.perf_counter() - begun, "cpu": sum(os.times()[:4]) - cpu,
        "candidates": {f"{c['name']}@{c['at']}": c["score"] for c in answer["candidates"]}, "notes": answer["notes"],
    }  # fmt: skip


def line(row: dict[str, Any]) -> str:
    """A case in words: what is concealed, what was found and named, and the processor time."""
    truth = ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else str(v) for k, v in row["truth"].items())
    found = ", ".join(f"{k} {v:.3g}" for k, v in (row["found"] or {}).items())
    return (
        f"{'ok ' if row['right'] else 'BAD'} {row['effect']:<20}{row['seed']:>3}  {truth} | {found or '–'} | "
        f"{', '.join(row['named']) or row['verdict']} ({row['cpu']:.0f} s CPU)"
    )


if __name__ == "__main__":
    sys.exit(main(__doc__ or "", EFFECTS, run_case, record, line, ROOT / "build" / "docking_concealed.jsonl"))
