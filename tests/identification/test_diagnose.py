"""Whole diagnoses of arms that MuJoCo moved, with LuGre friction and a servo: none of it is snarelab's own dynamics."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Elasticity, Harness, Payload
from snarelab.cli import main

JOINTS = ("joint1", "joint2", "joint3")
NEIGHBOURS = {f"{a}{sign}{b}" for a, b in pairwise(JOINTS) for sign in "+-"}
LEVELS = {"joint1": 8.0, "joint2": 5.0, "joint3": 2.0}
BUNDLED = Path(__file__).resolve().parents[2] / "studies" / "bundled"
FRICTION = ("viscous_friction", "coulomb_friction", "presliding_hysteresis")


def diagnosed(folder: Path, seed: int, effects=FRICTION, **concealed):
    """Record a random three-joint arm that has friction, disturbances and ``concealed``; diagnose it."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 3)
    plant = Plant(
        arm,
        friction={j: LuGre(level=x, viscous=0.8 * x) for j, x in LEVELS.items()},
        encoder_step=dict.fromkeys(JOINTS, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(JOINTS, 0.1),
        disturbance=dict.fromkeys(JOINTS, Disturbance(0.3, 0.3, 15.0)),
        **concealed,
    )
    (folder / "arm.urdf").write_text(arm.urdf())
    listed = ", ".join(f'"{e}"' for e in effects)
    (folder / "arm.toml").write_text(f'name = "arm"\nsystem = "arm"\nurdf = "arm.urdf"\neffects = [{listed}]\n')
    write_csv(folder / "train.csv", simulate(plant, fourier_motion(arm, rng, 15.0), 15.0, 200.0, rng))
    write_csv(folder / "hold.csv", simulate(plant, point_to_point_motion(arm, rng, 9.0), 9.0, 200.0, rng))
    return run(folder / "arm.toml", folder / "train.csv", folder / "hold.csv", folder / "out.json")


def run(model, train, holdout, out):
    assert main(["diagnose", str(model), str(train), "--holdout", str(holdout), "--json", str(out)]) == 0
    return json.loads(out.read_text())


def named(found):
    return {(e["name"], e["at"]) for e in found["effects"]}


def parameters(found, name, at):
    (effect,) = [e for e in found["effects"] if (e["name"], e["at"]) == (name, at)]
    return {k: v["value"] for k, v in effect["parameters"].items()}


@pytest.fixture(scope="module")
def bundled(tmp_path_factory, each_diagnosis_once):
    out = tmp_path_factory.mktemp("bundled") / "out.json"
    return run(BUNDLED / "arm3.toml", BUNDLED / "train.csv", BUNDLED / "holdout.csv", out)


def test_bundled_recording_gives_its_answer(bundled):
    answer = json.loads((BUNDLED / "answer.json").read_text())
    wanted = {(e["name"], e["at"]) for e in answer["effects"]}
    assert named(bundled) == wanted
    for effect in answer["effects"]:
        found = parameters(bundled, effect["name"], effect["at"])
        for name, true in effect["parameters"].items():
            assert found[name] == pytest.approx(true["value"], rel=0.15), (effect["name"], effect["at"], name)


def test_bundled_fit_improves_to_near_the_noise_on_the_recording_held_out(bundled):
    for fit in bundled["fit"].values():
        assert fit["holdout"]["rms_after"] < 0.2 * fit["holdout"]["rms_before"]
        assert fit["holdout"]["rms_after"] < 3 * fit["noise_floor"]


@pytest.mark.parametrize("seed", [101, pytest.param(102, marks=pytest.mark.slow)])
def test_nothing_missing_is_adequate(tmp_path, seed):
    found = diagnosed(tmp_path, seed)
    assert found["verdict"] == "adequate", named(found)
    assert found["effects"] == []
    assert {x["name"] for x in found["limits"]} >= {"sensor_bias", "harness_stiffness", "rotor_inertia", "com_offset"}
    for name in ("rotor_inertia", "quadratic_friction", "load_dependent_friction", "stribeck_friction"):
        # Also where the best fit would be a negative one.
        coupled = NEIGHBOURS if name == "rotor_inertia" else set()
        assert {x["at"] for x in found["limits"] if x["name"] == name} == {*JOINTS, *coupled}, name


@pytest.mark.slow
def test_payload_is_weighed(tmp_path):
    found = diagnosed(tmp_path, 103, payload=Payload(1.5, (0.0, 0.0, 0.1)))
    assert named(found) == {("payload_mass", "link3")}
    assert parameters(found, "payload_mass", "link3")["mass"] == pytest.approx(1.5, rel=0.05)


@pytest.mark.slow
def test_harness_bias_and_late_sensor_are_told_apart(tmp_path):
    found = diagnosed(
        tmp_path, 104, harness={"joint2": Harness(6.0, 0.1)}, tau_bias={"joint1": 2.0}, tau_delay={"joint3": 0.006}
    )
    assert ("harness_stiffness", "joint2") in named(found)
    assert ("sensor_bias", "tau.joint1") in named(found)
    assert parameters(found, "harness_stiffness", "joint2")["stiffness"] == pytest.approx(6.0, rel=0.1)
    assert parameters(found, "sensor_bias", "tau.joint1")["offset"] == pytest.approx(2.0, rel=0.1)


@pytest.mark.slow
def test_springy_drive_is_named_with_its_stiffness(tmp_path):
    found = diagnosed(
        tmp_path,
        105,
        effects=(*FRICTION, "rotor_inertia"),
        armature={"joint1": 3.0},
        elasticity={"joint1": Elasticity(3000.0, 15.0)},
    )
    assert ("joint_elasticity", "joint1") in named(found)
    assert parameters(found, "joint_elasticity", "joint1")["stiffness"] == pytest.approx(3000.0, rel=0.1)
