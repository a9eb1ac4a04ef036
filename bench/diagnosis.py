"""Wall time of ``snarelab diagnose``: six joints, 60 s at 200 Hz, every effect at every joint, and where the time goes.

``python bench/diagnosis.py [RESULT.json]``. The recording is MuJoCo's with LuGre friction, a harness on one joint and a
torque gain error on another (`bench/mujoco_plant.py`); it is made once and kept under ``build/bench/diagnosis``.
"""

import contextlib
import cProfile
import io
import json
import os
import pstats
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Harness
from snarelab.cli import main as snarelab

N_JOINTS, SECONDS, RATE, GOAL, TOP = 6, 60.0, 200.0, 60.0, 12
EFFECTS = '["viscous_friction", "coulomb_friction", "presliding_hysteresis"]'


def make(folder: Path) -> None:
    """Write the model, and a recording each to fit and to hold out."""
    rng = np.random.default_rng(5)
    arm = random_arm(rng, N_JOINTS)
    plant = Plant(
        arm,
        friction={
            j: LuGre(level=x, viscous=0.8 * x) for j, x in zip(arm.joints, np.linspace(8, 2, N_JOINTS), strict=True)
        },
        harness={"joint3": Harness(4.0, 0.1)},
        tau_gain={"joint5": 1.08},
        encoder_step=dict.fromkeys(arm.joints, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(arm.joints, 0.1),
        disturbance=dict.fromkeys(arm.joints, Disturbance(0.3)),
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = {EFFECTS}\n')
    write_csv(folder / "train.csv", simulate(plant, fourier_motion(arm, rng, SECONDS), SECONDS, RATE, rng))
    # Last: its presence says that all of it is there.
    write_csv(folder / "holdout.csv", simulate(plant, point_to_point_motion(arm, rng, 20.0), 20.0, RATE, rng))


def diagnose(folder: Path) -> float:
    """Wall time of the command [s]; what it says is not shown."""
    start = time.perf_counter()
    words = ("diagnose", "arm.toml", "train.csv", "--holdout", "holdout.csv", "--json", "found.json")
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        status = snarelab(words)
    if status:
        raise RuntimeError(f"snarelab diagnose ended with status {status}")
    return time.perf_counter() - start


def main() -> int:
    """Time it, profile it, print and write."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/diagnosis.json").resolve()
    folder = path.parent / "diagnosis"
    if not (folder / "holdout.csv").exists():
        make(folder)
    seconds = diagnose(folder)
    profile = cProfile.Profile()
    profile.runcall(diagnose, folder)
    stats = pstats.Stats(profile).get_stats_profile()
    own = [
        (f"{Path(part.file_name).name}:{name}", part.tottime, part.cumtime)
        for name, part in stats.func_profiles.items()
    ]
    parts = sorted(own, key=lambda part: -part[1])[:TOP]
    found = json.loads((folder / "found.json").read_text())
    named = [f"{e['name']} at {e['at']}" for e in found["effects"]]
    print(f"{N_JOINTS} joints, {SECONDS:g} s at {RATE:g} Hz, {os.cpu_count()} cores: {found['verdict']}, {named}")
    print(f"snarelab diagnose: {seconds:.1f} s (goal: at most {GOAL:g} s); under the profiler, by own time:")
    for name, alone, inside in parts:
        print(f"  {name:46}{alone:8.2f} s{inside:9.2f} s with what it calls")
    result = {"bench": "diagnosis", "seconds": seconds, "goal": GOAL, "verdict": found["verdict"], "named": named}
    result["profile"] = [{"name": n, "own_seconds": a, "seconds": b} for n, a, b in parts]
    path.write_text(json.dumps(result, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
