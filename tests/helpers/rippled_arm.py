"""Recordings that MuJoCo made of an arm of two joints with friction, the second of which may ripple."""

import numpy as np
import pandas as pd

from bench.arm import random_arm
from bench.motion import fourier_motion
from bench.mujoco_plant import Plant, simulate
from bench.parts import SolverFriction
from snarelab.models.model_file import load_model


def rippled(folder, seed, ripple, effects=("viscous_friction", "coulomb_friction"), seconds=(30.0, 20.0)):
    """A model beside train.csv and hold.csv; ``ripple``: a part of `bench.parts`, or several, at joint2."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 2)
    noise = {j: 0.3 for j in arm.joints}, {j: 1e-5 for j in arm.joints}
    friction = {j: SolverFriction(3.0, 2.0) for j in arm.joints}
    plant = Plant(arm, friction=friction, ripple=ripple, tau_noise=noise[0], encoder_noise=noise[1])
    (folder / "arm.urdf").write_text(arm.urdf())
    for name, length in zip(("train.csv", "hold.csv"), seconds, strict=True):
        table = simulate(plant, fourier_motion(arm, rng, length), length, 200.0, rng)
        pd.DataFrame(table).to_csv(folder / name, index=False)
    (folder / "arm.toml").write_text(f'name = "arm"\nurdf = "arm.urdf"\neffects = {list(effects)!r}\n')
    return load_model(folder / "arm.toml")


def travel(folder, joint="joint2"):
    return float(np.ptp(pd.read_csv(folder / "train.csv")[f"q.{joint}"]))
