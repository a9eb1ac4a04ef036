"""What noise of coarse encoders, sampled slowly, must not be read as; what knocks once, and what keeps coming back."""

import numpy as np
import pytest
from pendulum import diagnosed

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

JOINTS = tuple(f"joint{k}" for k in range(1, 7))
LEVELS = dict(zip(JOINTS, (8.0, 5.0, 2.0, 0.6, 0.3, 0.2), strict=True))


@pytest.mark.slow
def test_a_clean_arm_at_100_hz_and_16_bits_is_adequate(tmp_path):
    """Noise of the encoders stands in the torque of the heavy joints, and is far stronger in some poses than in others:
    it was bursts."""
    rng = np.random.default_rng(301)
    arm = random_arm(rng, 6)
    plant = Plant(
        arm,
        friction={
            j: LuGre(level=x, viscous=0.8 * x) for j, x in zip(JOINTS, (8.0, 5.0, 2.0, 0.6, 0.3, 0.2), strict=True)
        },
        encoder_step=dict.fromkeys(JOINTS, 2 * np.pi / 2**16),
        tau_noise=dict.fromkeys(JOINTS, 0.05),
        disturbance=dict.fromkeys(JOINTS, Disturbance(0.05, 0.3, 15.0)),
    )
    (tmp_path / "arm.urdf").write_text(arm.urdf())
    (tmp_path / "arm.toml").write_text(
        'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\n'
        'effects = ["viscous_friction", "coulomb_friction", "presliding_hysteresis"]\n'
    )
    write_csv(tmp_path / "train.csv", simulate(plant, fourier_motion(arm, rng, 12.0), 12.0, 100.0, rng))
    write_csv(tmp_path / "hold.csv", simulate(plant, point_to_point_motion(arm, rng, 9.0), 9.0, 100.0, rng))
    found = diagnose(load_model(tmp_path / "arm.toml"), [tmp_path / "train.csv"], tmp_path / "hold.csv").diagnosis
    assert found.verdict == "adequate", (found.description, [(e.name, e.at) for e in found.effects])


def test_what_knocks_once_is_noted_and_what_comes_again_has_no_name(tmp_path):
    once = diagnosed(tmp_path, 1, knocks=(7.3,))
    assert once.verdict == "adequate", once.sentence
    assert any("do not recur" in note and "tau.joint1" in note for note in once.notes)
    again = diagnosed(tmp_path, 1, knocks=(3.3, 7.3, 10.9))
    assert again.verdict == "unknown_effect", again.sentence
    assert "comes in bursts, at 6.8 Hz" in again.description or "comes in bursts, at 7 Hz" in again.description
    assert not any("do not recur" in note for note in again.notes)
