"""Time of ``snarelab diagnose``: six joints, 60 s at 200 Hz, every effect at every joint, and where the time goes.

``python bench/diagnosis.py [RESULT.json]``. The recording is MuJoCo's with LuGre friction, a harness on one joint and a
torque gain error on another (`bench/mujoco_plant.py`); it is made once and kept under ``build/bench/diagnosis``.

Three goals: the whole diagnosis on two cores and on one, and the general test of nameless curves by itself on one core:
the columns of all curves of all joints, the noise learnt beside them, and the search among them, with no named effect.
It stands on the arguments that the diagnosis gave for the model as given. Both run in one process with one thread, so
one measurement is held against the goals for one core and for two. Beside wall time stands processor time, which a busy
machine leaves comparable.
"""

import contextlib
import cProfile
import io
import json
import os
import pstats
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

from snarelab.threads import one_thread

one_thread()  # before numpy is imported

import numpy as np

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Harness
from snarelab.cli import main as snarelab
from snarelab.identification.arms import hypotheses, kind, weigh
from snarelab.identification.evidence.tolerant import searched

N_JOINTS, SECONDS, RATE, TOP = 6, 60.0, 200.0, 12
GOALS = {"diagnosis, two cores": 8.0, "diagnosis, one core": 20.0, "general test, one core": 5.0}
"""[s] At most."""
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


@contextlib.contextmanager
def instead(module: Any, **given: Any) -> Iterator[None]:
    """Other values of a module's names for a while."""
    before = {name: getattr(module, name) for name in given}
    for name, value in given.items():
        setattr(module, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(module, name, value)


class Clock:
    """Wall and processor time of all calls of a function [s], and the arguments of the first."""

    def __init__(self, function: Callable[..., Any]) -> None:
        """Of a function."""
        self.function, self.wall, self.processor = function, 0.0, 0.0
        self.first: tuple[tuple[Any, ...], dict[str, Any]] | None = None

    def __call__(self, *words: Any, **named: Any) -> Any:
        """Call it."""
        self.first = self.first or (words, named)
        wall, processor = time.perf_counter(), time.process_time()
        try:
            return self.function(*words, **named)
        finally:
            self.wall += time.perf_counter() - wall
            self.processor += time.process_time() - processor


def diagnose(folder: Path) -> None:
    """Run the command; what it says is not shown."""
    words = ("diagnose", "arm.toml", "train.csv", "--holdout", "holdout.csv", "--json", "found.json")
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        status = snarelab(words)
    if status:
        raise RuntimeError(f"snarelab diagnose ended with status {status}")


def general_test(words: tuple[Any, ...], named: dict[str, Any]) -> dict[str, Clock]:
    """Time the test of nameless curves by itself, with the arguments of a diagnosis' first weighing; its parts too."""

    def test() -> None:
        weighed = weigh.weigh(*words, **named)
        searched(weighed, range(weighed.n_train), (), range(len(weighed.noises)))

    parts = {"columns of curves": Clock(hypotheses.curves), "noise": Clock(weigh._noise), "in all": Clock(test)}
    own = {"curves": parts["columns of curves"], "_noise": parts["noise"]}
    with instead(weigh, names=lambda *_: {}, library=lambda _: [], **own):
        parts["in all"]()
    return parts


def main() -> int:
    """Time it, profile it, print and write."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/diagnosis.json").resolve()
    folder = path.parent / "diagnosis"
    if not (folder / "holdout.csv").exists():
        make(folder)
    profile = cProfile.Profile()
    profile.runcall(diagnose, folder)  # first, for it compiles the model
    whole, first = Clock(diagnose), Clock(weigh.weigh)
    with instead(kind, weigh=first):
        whole(folder)
    assert first.first is not None
    test = general_test(*first.first)
    stats = pstats.Stats(profile).get_stats_profile()
    own = [
        (f"{Path(part.file_name).name}:{name}", part.tottime, part.cumtime)
        for name, part in stats.func_profiles.items()
    ]
    parts = sorted(own, key=lambda part: -part[1])[:TOP]
    found = json.loads((folder / "found.json").read_text())
    named = [f"{e['name']} at {e['at']}" for e in found["effects"]]
    print(f"{N_JOINTS} joints, {SECONDS:g} s at {RATE:g} Hz, {os.cpu_count()} cores: {found['verdict']}, {named}")
    clocks = dict(zip(GOALS, (whole, whole, test["in all"]), strict=True))
    for name, goal in GOALS.items():
        took = clocks[name]
        print(f"{name:26}{took.wall:8.1f} s wall{took.processor:8.1f} s processor   (goal: at most {goal:g} s)")
    for name in ("columns of curves", "noise"):
        print(f"  of the test, {name:20}{test[name].processor:8.2f} s processor")
    print("snarelab diagnose under the profiler, by own time:")
    for name, alone, inside in parts:
        print(f"  {name:46}{alone:8.2f} s{inside:9.2f} s with what it calls")
    result = {"bench": "diagnosis", "verdict": found["verdict"], "named": named}
    result["times"] = [
        {"name": n, "seconds": c.wall, "processor_seconds": c.processor, "goal": GOALS[n]} for n, c in clocks.items()
    ]
    result["profile"] = [{"name": n, "own_seconds": a, "seconds": b} for n, a, b in parts]
    path.write_text(json.dumps(result, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
