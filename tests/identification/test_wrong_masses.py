"""A robot file's masses are off by some per cent, and nothing else is missing."""

from dataclasses import replace

import numpy as np
from short_recordings import diagnosed

from bench.arm import Arm, random_arm
from bench.lugre import LuGre
from bench.mujoco_plant import Plant
from bench.parts import Disturbance

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
    found = diagnosed(tmp_path, plant, stated, rng)
    assert found.verdict != "unknown_effect", found.sentence
    assert {e.name for e in found.effects} <= {"payload_mass", "inertia_error"}, found.sentence
