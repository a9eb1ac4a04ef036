"""Cost of a fast recording: six joints, 60 s at 5 kHz, through ``check``, ``identify`` and ``diagnose``.

The bar is 30 s and 700 MB on two cores for each.

``python bench/fast.py [RESULT.json]``. The arm is MuJoCo's of `bench/diagnosis.py`, recorded at 1 kHz and put on 5 kHz
by cubic splines; what encoders and torque sensors add is drawn at 5 kHz. Each command runs in a process of its
own, whose peak of memory and processor time the system tells. Seconds of processor time are what a busy machine leaves
comparable.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from bench.arm import random_arm
from bench.diagnosis import EFFECTS
from bench.diagnosis import N_JOINTS as JOINTS
from bench.lugre import LuGre
from bench.motion import fourier_motion
from bench.mujoco_plant import Plant, simulate
from bench.results import write_result

SECONDS, HELD, RATE, MADE_AT = 60.0, 20.0, 5000.0, 1000.0
STEP, NOISE = 2 * np.pi / 2**20, 0.1
MOST_SECONDS, MOST_BYTES = 30.0, 700e6


def make(folder: Path) -> None:
    """Write the model, and a recording each to fit and to hold out."""
    rng = np.random.default_rng(5)
    arm = random_arm(rng, JOINTS)
    levels = zip(arm.joints, np.linspace(8, 2, JOINTS), strict=True)
    plant = Plant(arm, friction={j: LuGre(level=x, viscous=0.8 * x) for j, x in levels})
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = {EFFECTS}\n')
    for name, seconds in (("train", SECONDS), ("holdout", HELD)):
        slow = pd.DataFrame(simulate(plant, fourier_motion(arm, rng, seconds), seconds, MADE_AT, rng))
        start, stop = slow["time"].iloc[[0, -1]]
        table = {"time": np.arange(round((stop - start) * RATE)) / RATE + start}
        for joint in arm.joints:
            q, tau = (CubicSpline(slow["time"], slow[f"{x}.{joint}"])(table["time"]) for x in ("q", "tau"))
            table[f"q.{joint}"] = np.round(q / STEP) * STEP
            table[f"tau.{joint}"] = tau + NOISE * rng.normal(size=len(tau))
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", index=False, float_format="%.9g")


def cost(*words: str) -> dict[str, float]:
    """Wall and processor seconds, and peak memory [bytes], of a command in a process of its own."""
    start, program = time.perf_counter(), "import sys; from snarelab.cli import main; sys.exit(main(sys.argv[1:]))"
    process = subprocess.Popen([sys.executable, "-c", program, *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"snarelab {words[0]} ended with status {os.waitstatus_to_exitcode(status)}")
    wall = time.perf_counter() - start
    return {"seconds": wall, "processor": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss * 1024.0}


def main() -> int:
    """Make it where it is missing, measure, print and write."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/fast.json").resolve()
    folder = path.parent / "fast"
    if not (folder / "holdout.csv").exists():
        make(folder)
    model, train, held = (str(folder / name) for name in ("arm.toml", "train.csv", "holdout.csv"))
    commands = {
        "check": ("check", model, train),
        "identify": ("identify", model, train, "--holdout", held),
        "diagnose": ("diagnose", model, train, "--holdout", held),
    }
    result = {}
    for name, words in commands.items():
        result[name] = found = cost(*words)
        kept = found["processor"] <= MOST_SECONDS and found["memory"] <= MOST_BYTES
        print(
            f"{name:<10}{found['seconds']:7.1f} s, {found['processor']:6.1f} s of processor, "
            f"{found['memory'] / 1e6:6.0f} MB{'' if kept else '  beyond the bar'}"
        )
    write_result(path, {**result, "bar": {"seconds": MOST_SECONDS, "memory": MOST_BYTES}})
    return 0


if __name__ == "__main__":
    sys.exit(main())
