"""Recordings that MuJoCo made of an arm with friction, and what a drive's current or a servo's command was then."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import make_interp_spline

from bench.arm import random_arm
from bench.motion import fourier_motion
from bench.mujoco_plant import Plant, simulate
from bench.parts import SolverFriction

LEVEL, VISCOUS = 3.0, 2.0
RATE = 200.0
EFFECTS = ["viscous_friction", "coulomb_friction"]


def recorded(folder: Path, names="ab", seconds=20.0, seed=1):
    """The arm's URDF in the folder, its joints, and a table of each motion."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 3)
    friction = {j: SolverFriction(LEVEL, VISCOUS) for j in arm.joints}
    noise = {j: 0.3 for j in arm.joints}, {j: 1e-5 for j in arm.joints}
    plant = Plant(arm, friction=friction, tau_noise=noise[0], encoder_noise=noise[1])
    (folder / "arm.urdf").write_text(arm.urdf())
    made = [simulate(plant, fourier_motion(arm, rng, seconds), seconds, RATE, rng) for _ in names]
    return arm.joints, [pd.DataFrame(x) for x in made]


def speed(table, joint):
    """Rate of a recorded position, by a quintic spline."""
    return make_interp_spline(table["time"], table[f"q.{joint}"], k=5).derivative()(table["time"])


def model_file(folder: Path, lines="", effects=EFFECTS, name="m.toml"):
    path = folder / name
    path.write_text(f'name = "m"\nurdf = "arm.urdf"\neffects = {list(effects)!r}\n{lines}', encoding="utf-8")
    return path
