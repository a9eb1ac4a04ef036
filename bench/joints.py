"""Cost of a diagnosis by number of joints: UR5, Go2 and G1 of ``example-robot-data`` (6, 12, 29), 60 s at 200 Hz.

The bar is that time and memory grow no faster than the joints do. ``python bench/joints.py [RESULT.json]``. Torque is
Pinocchio's of the published URDF, base held, with viscous and Coulomb friction, noise, and a spring on one joint that
the model leaves out; each diagnosis runs in a process of its own, whose peak of memory and processor time the
system tells. Recordings are made once and kept; a robot that was measured is not measured again.
"""

import json
import sys
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

import numpy as np
import pandas as pd
import pinocchio

from bench.fast import cost
from bench.results import write_result

pin: Any = pinocchio  # its names come from a compiled module
ROBOTS = {
    "UR5": "ur_description/urdf/ur5_robot.urdf",
    "Go2": "go2_description/urdf/go2.urdf",
    "G1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
}
SECONDS, HELD, RATE = 60.0, 20.0, 200.0
STEP, SPEED, SPRING = 2 * np.pi / 2**18, 1.0, 0.3
"""Of the encoders [rad]; peak speed [rad/s]; the spring's share of the joint's torque per rad."""


def make(urdf: Path, folder: Path) -> int:
    """Write the model, and a recording each to fit and to hold out; returns the number of joints."""
    rng = np.random.default_rng(5)
    model = pin.buildModelFromUrdf(str(urdf))
    data, names = model.createData(), list(model.names[1:])
    middle = (model.lowerPositionLimit + model.upperPositionLimit) / 2
    reach = np.minimum((model.upperPositionLimit - model.lowerPositionLimit) / 2, 1.0)
    size = np.abs(np.array(pin.rnea(model, data, middle, 0 * middle, reach))) + 0.5
    folder.mkdir(parents=True, exist_ok=True)
    listed = ", ".join(f'"{n}"' for n in names)
    (folder / "arm.toml").write_text(
        f'name = "arm"\nsystem = "arm"\nurdf = "{urdf}"\njoints = [{listed}]\n'
        'effects = ["viscous_friction", "coulomb_friction"]\n'
    )
    for name, seconds in (("train", SECONDS), ("holdout", HELD)):
        t = np.arange(round(seconds * RATE)) / RATE
        w = 2 * np.pi * rng.uniform(0.05, 0.4, (len(names), 4))
        share = rng.dirichlet(np.ones(4), len(names)) * np.minimum(reach, SPEED / w.max(axis=1))[:, None]
        turn = w[:, :, None] * t + rng.uniform(0, 2 * np.pi, (len(names), 4))[:, :, None]
        q = middle[:, None] + np.sum(share[:, :, None] * np.sin(turn), axis=1)
        qd = np.sum((share * w)[:, :, None] * np.cos(turn), axis=1)
        qdd = -np.sum((share * w**2)[:, :, None] * np.sin(turn), axis=1)
        tau = np.array([pin.rnea(model, data, *(x[:, k] for x in (q, qd, qdd))) for k in range(len(t))]).T
        tau += size[:, None] * (0.1 * qd + 0.1 * np.sign(qd) + 0.02 * rng.normal(size=q.shape))
        tau[1] += SPRING * size[1] * (q[1] - middle[1])
        table = {"time": t}
        for k, joint in enumerate(names):
            table[f"q.{joint}"], table[f"tau.{joint}"] = np.round(q[k] / STEP) * STEP, tau[k]
        pd.DataFrame(table).to_csv(folder / f"{name}.csv", index=False, float_format="%.9g")
    return len(names)


def main() -> int:
    """Make what is missing, measure what was not, print and write."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench/joints.json").resolve()
    place = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    result = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for robot, urdf in ROBOTS.items():
        folder = path.parent / "joints" / robot
        if robot not in result:
            joints = make(place / urdf, folder)
            model, train, held, answer = (str(folder / x) for x in ("arm.toml", "train.csv", "holdout.csv", "out.json"))
            found = cost("diagnose", model, train, "--holdout", held, "--json", answer)
            named = [
                f"{e['name']} at {e['at']}" for e in json.loads(Path(answer).read_text(encoding="utf-8"))["effects"]
            ]
            result[robot] = {"joints": joints, **found, "named": named}
            write_result(path, result)
        own = result[robot]
        print(
            f"{robot:<5}{own['joints']:3} joints{own['seconds']:8.1f} s, {own['processor']:7.1f} s of processor, "
            f"{own['memory'] / 1e6:6.0f} MB: {', '.join(own['named']) or 'nothing named'}",
            flush=True,
        )
    first = result["UR5"]
    for robot, own in result.items():
        times = own["joints"] / first["joints"]
        print(
            f"{robot}: {times:.1f} times the joints, {own['processor'] / first['processor']:.1f} times the processor's "
            f"time, {own['memory'] / first['memory']:.1f} times the memory"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
