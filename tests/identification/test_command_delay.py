"""A drive that delivers its command late, in MuJoCo: a queue of commands stands before the joint.

The servo closes its loop through the delay, on the encoder.
"""

import numpy as np
import pytest

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.machine_parts import Queue
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

LEVELS = {"joint1": 3.0, "joint2": 5.0, "joint3": 2.0}
RATE = 200.0


def diagnosed(folder, seed, joints, **concealed):
    """Two recordings of a random arm with friction and disturbances, its motion up to 1.5 Hz, and the diagnosis."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, joints, 0.0)
    plant = Plant(
        arm,
        friction={j: LuGre(level=LEVELS[j], viscous=0.8 * LEVELS[j]) for j in arm.joints},
        encoder_step=dict.fromkeys(arm.joints, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(arm.joints, 0.1),
        disturbance=dict.fromkeys(arm.joints, Disturbance(0.1, 0.3, 15.0)),
        **concealed,
    )
    (folder / "arm.urdf").write_text(arm.urdf())
    (folder / "arm.toml").write_text(
        'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\n'
        'effects = ["viscous_friction", "coulomb_friction", "presliding_hysteresis"]\n'
    )
    motions = (("train", fourier_motion(arm, rng, 15.0, highest=1.5), 15.0),)
    motions += (("hold", point_to_point_motion(arm, rng, 9.0), 9.0),)
    for name, motion, seconds in motions:
        write_csv(folder / f"{name}.csv", simulate(plant, motion, seconds, RATE, rng))
    return diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "delay"), [(5, 0.01), (4, 0.02)])
def test_a_late_drive_of_an_arm_is_named_with_its_delay(tmp_path, seed, delay):
    """A late encoder would move the other joints' torque: it is no rival that cannot be told apart."""
    found = diagnosed(tmp_path, seed, 3, motor={"joint2": Queue(round(delay / 2.5e-4))})
    (only,) = found.effects
    assert (only.name, only.at) == ("command_delay", "tau.joint2"), found.sentence
    assert only.parameters["delay"].value == pytest.approx(delay, rel=0.15)
    assert not [r for r in only.rivals if not r.separable]


def test_of_one_joint_a_late_drive_and_a_late_encoder_are_one_answer(tmp_path):
    """Both are told, and what to measure: along one joint's own motion they make the same torque."""
    found = diagnosed(tmp_path, 5, 1, motor={"joint1": Queue(round(0.02 / 2.5e-4))})
    (only,) = found.effects
    rivals = [r for r in only.rivals if not r.separable]
    alike = {(only.name, only.at), *((r.name, r.at) for r in rivals)}
    assert alike == {("command_delay", "tau.joint1"), ("sensor_delay", "q.joint1")}, found.sentence
    assert only.parameters["delay"].value == pytest.approx(0.02, rel=0.15)
    assert only.probability + sum(r.probability for r in rivals) > 0.7
    assert all("joint1" in r.experiment and "second sensor" in r.experiment for r in rivals)
