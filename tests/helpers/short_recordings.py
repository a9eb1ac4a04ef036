"""A plant's two short recordings, one of many frequencies and one from point to point, and their diagnosis."""

from pathlib import Path

import numpy as np

from bench.arm import Arm
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from snarelab.identification.diagnose import diagnose
from snarelab.identification.diagnosis import Diagnosis
from snarelab.models.model_file import load_model

TRAIN, HOLD, RATE = 8.0, 6.0, 200.0  # s, s, Hz


def diagnosed(folder: Path, plant: Plant, stated: Arm, rng: np.random.Generator) -> Diagnosis:
    """The diagnosis of the plant by the arm that its URDF states."""
    (folder / "arm.urdf").write_text(stated.urdf())
    (folder / "arm.toml").write_text(
        'urdf = "arm.urdf"\neffects = ["viscous_friction", "coulomb_friction", "presliding_hysteresis"]\n'
    )
    train = fourier_motion(plant.arm, rng, TRAIN)
    hold = point_to_point_motion(plant.arm, rng, HOLD, slowest=0.3)
    write_csv(folder / "train.csv", simulate(plant, train, TRAIN, RATE, rng))
    write_csv(folder / "hold.csv", simulate(plant, hold, HOLD, RATE, rng))
    return diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis
