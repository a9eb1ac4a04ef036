"""An arm of two joints in a folder as a user has one: model file, URDF, two recordings; and commands on it."""

import numpy as np
import pandas as pd

from bench.arm import random_arm

MODEL = 'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = ["viscous_friction"]\n'


def table(seed, seconds=6.0, rate=100.0):
    """Two joints that move, with torques of no physical meaning: these tests are about paths, not physics."""
    rng, t = np.random.default_rng(seed), np.arange(round(seconds * rate)) / rate
    columns = {"time": t}
    for k, joint in enumerate(("joint1", "joint2"), 1):
        columns[f"q.{joint}"] = np.sin((1.3 + 0.4 * k + 0.1 * seed) * t) + 0.3 * np.sin(4.1 * k * t + seed)
        columns[f"tau.{joint}"] = 5.0 * np.cos(2.0 * k * t) + 0.1 * rng.normal(size=len(t))
    return pd.DataFrame(columns)


def write_arm_folder(folder):
    """The files, where the tests of commands run."""
    (folder / "arm.urdf").write_text(random_arm(np.random.default_rng(0), 2).urdf())
    (folder / "arm.toml").write_text(MODEL)
    table(0).to_csv(folder / "train.csv", index=False)
    table(1).to_csv(folder / "hold.csv", index=False)


def arguments(command, recording="train.csv", model="arm.toml", holdout="hold.csv"):
    outputs = ["--json", "out.json", "--save-model", "new.toml"]
    if command == "simulate":
        return [command, model, "--motion", recording, "--out", "out.csv"]
    if command == "diagnose":
        outputs += ["--report", "out.html"]
    return [command, model, recording, "--holdout", holdout, *outputs]
