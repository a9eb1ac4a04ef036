"""A motor whose iron saturates, in MuJoCo: what is logged is its current times a constant, more than it gives."""

import numpy as np
import pytest
from short_recordings import diagnosed

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.machine_laws import tanh_motor
from bench.machine_parts import Iron
from bench.mujoco_plant import Plant
from bench.parts import Disturbance


@pytest.mark.slow
def test_a_motor_that_saturates_is_not_wrongly_named(tmp_path):
    """By its name, or as something without one. That is one seed at which it is right, of a law that the vocabulary
    does not have; `bench/machines.py` counts the share of seeds, and not all of them are."""
    rng = np.random.default_rng(6)
    arm = random_arm(rng, 1, 0.0)
    plant = Plant(
        arm,
        friction={"joint1": LuGre(level=5.0, viscous=4.0)},
        encoder_step={"joint1": 2 * np.pi / 2**20},
        tau_noise={"joint1": 0.1},
        disturbance={"joint1": Disturbance(0.2, 0.3, 15.0)},
        # Its largest load is four tenths of this torque, and takes a fourteenth more current than a straight line.
        motor={"joint1": Iron(lambda asked: float(tanh_motor(asked, 64.0)))},
    )
    found = diagnosed(tmp_path, plant, arm, rng)
    names = [(e.name, e.at) for e in found.effects]
    assert found.verdict == "unknown_effect" or names == [("motor_saturation", "tau.joint1")], found.sentence
