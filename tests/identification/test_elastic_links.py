"""A spring inside a link of MuJoCo's arm, which its URDF says nothing of, and the same arms without it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bench.arm import Arm, random_arm
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Beam, Disturbance, SolverFriction
from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

RATE, TRAIN, HOLDOUT, ROTOR = 200.0, 18.0, 10.0, 0.05
# MuJoCo's link starts unloaded and rings at first, which no start at rest predicts: of 10 s that is a block of six.
STIFFNESS = 500.0


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """The diagnosis of an arm of four joints with a link that twists, or with none."""

    @cache
    def run(seed, link="", straight=False):
        folder = tmp_path_factory.mktemp("arm")
        rng = np.random.default_rng(seed)
        arm = random_arm(rng, 4)
        if straight:
            arm = Arm(tuple(replace(x, rpy=np.zeros(3)) for x in arm.links))
        plant = Plant(
            arm,
            armature=dict.fromkeys(arm.joints, ROTOR),
            beam={link: Beam(torsion=STIFFNESS, damping=1e-3 * STIFFNESS)} if link else {},
            friction={j: SolverFriction(2.0, 1.5) for j in arm.joints},
            disturbance=dict.fromkeys(arm.joints, Disturbance(0.15)),
            tau_noise=dict.fromkeys(arm.joints, 0.1),
            encoder_noise=dict.fromkeys(arm.joints, 1e-5),
        )
        motions = fourier_motion(arm, rng, TRAIN), point_to_point_motion(arm, rng, HOLDOUT)
        for name, motion, seconds in zip(("train", "hold"), motions, (TRAIN, HOLDOUT), strict=True):
            write_csv(folder / f"{name}.csv", simulate(plant, motion, seconds, RATE, rng))
        (folder / "arm.urdf").write_text(arm.urdf())
        known = '["viscous_friction", "coulomb_friction", "rotor_inertia"]'
        (folder / "arm.toml").write_text(f'name = "arm"\nurdf = "arm.urdf"\neffects = {known}\n')
        return diagnose(load_model(folder / "arm.toml"), [folder / "train.csv"], folder / "hold.csv").diagnosis

    return run


@pytest.mark.slow
def test_a_twisting_link_is_named_with_its_stiffness(diagnosed):
    """The spring changes torques by several times the disturbance on joints 1 to 3."""
    found = diagnosed(1, "link2")
    assert [(e.name, e.at) for e in found.effects] == [("link_torsion", "link2")]
    assert found.effects[0].parameters["stiffness"].value == pytest.approx(STIFFNESS, rel=0.1)


@pytest.mark.slow
def test_torsion_before_a_joint_about_the_links_length_is_one_answer_with_its_elasticity(diagnosed):
    """Seed 5: joint 2 turns about the length of link 1, so its drive's spring and the link's are one in series."""
    found = diagnosed(5, "link1", True)
    (effect,) = found.effects
    answers = {(effect.name, effect.at), *((r.name, r.at) for r in effect.rivals if not r.separable)}
    assert {("link_torsion", "link1"), ("joint_elasticity", "joint2")} <= answers
    assert effect.parameters["stiffness"].value == pytest.approx(STIFFNESS, rel=0.2)


def test_an_arm_with_stiff_links_stays_clean(diagnosed):
    """How often a clean arm is told a name is counted by the proof."""
    assert diagnosed(1).verdict == "adequate"
