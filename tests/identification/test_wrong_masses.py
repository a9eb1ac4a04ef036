"""A robot file's masses are off by some per cent, and nothing else is missing."""

from dataclasses import replace

import numpy as np

from bench.arm import Arm, random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

LEVELS = {"joint1": 5.0, "joint2": 2.0}


def test_masses_that_are_off_by_a_few_per_cent_are_no_other_physics(tmp_path):
    """Were they trusted, the second link's centre of mass would be named."""
    rng = np.random.default_rng(4)
    arm = random_arm(rng, 2, 0.0)
    off = zip(arm.links, (0.97, 1.03), strict=True)
    stated = Arm(tuple(replace(link, mass=float(factor * link.mass)) for link, factor in off))
    plant = Plant(
        arm,
        friction={j: LuGre(level=x, viscous=0.8 * x) for j, x in LEVELS.items()},
        encoder_step=dict.fromkeys(LEVELS, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(LEVELS, 0.1),
        disturbance=dict.fromkeys(LEVELS, Disturbance(0.1, 0.3, 15.0)),
    )
    (tmp_path / "arm.urdf").write_text(stated.urdf())
    (tmp_path / "arm.toml").write_text(
        'urdf = "arm.urdf"\neffects = ["viscous_friction", "coulomb_friction", "presliding_hysteresis"]\n'
    )
    train, hold = fourier_motion(arm, rng, 8.0), point_to_point_motion(arm, rng, 6.0, slowest=0.3)
    write_csv(tmp_path / "train.csv", simulate(plant, train, 8.0, 200.0, rng))
    write_csv(tmp_path / "hold.csv", simulate(plant, hold, 6.0, 200.0, rng))
    found = diagnose(load_model(tmp_path / "arm.toml"), [tmp_path / "train.csv"], tmp_path / "hold.csv").diagnosis
    assert found.verdict != "unknown_effect", found.sentence
    assert {e.name for e in found.effects} <= {"payload_mass", "inertia_error"}, found.sentence
