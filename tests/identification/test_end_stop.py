"""Stops that MuJoCo's arms meet are named as stops, and springs across a joint are not."""

import json
from dataclasses import replace

import numpy as np
import pytest

from bench.arm import random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Harness, Stop
from snarelab.cli import main

LEVELS = {"joint1": 8.0, "joint2": 5.0, "joint3": 2.0}
FRICTION = ("viscous_friction", "coulomb_friction", "presliding_hysteresis")

RMS = 0.3
"""Of the disturbance at every joint [N·m]."""


def diagnosed(folder, seed, make):
    """An arm whose joint 2 has what ``make`` gives for its planned travel (n,) [rad]; both recordings cover it."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng, 3)
    motions = [fourier_motion(arm, rng, 15.0) for _ in range(2)]
    ways = [m(np.linspace(0, 15, 3000))[0][:, 1] for m in motions]
    part, value = make(ways)
    plant = Plant(
        arm,
        friction={j: LuGre(level=x, viscous=0.8 * x) for j, x in LEVELS.items()},
        encoder_step=dict.fromkeys(LEVELS, 2 * np.pi / 2**20),
        tau_noise=dict.fromkeys(LEVELS, 0.1),
        disturbance=dict.fromkeys(LEVELS, Disturbance(RMS, 0.3, 15.0)),
    )
    plant = replace(plant, **{part: {"joint2": value}})
    (folder / "arm.urdf").write_text(arm.urdf())
    listed = ", ".join(f'"{e}"' for e in FRICTION)
    (folder / "arm.toml").write_text(f'system = "arm"\nurdf = "arm.urdf"\neffects = [{listed}]\n')
    for name, motion in zip(("train", "hold"), motions, strict=True):
        write_csv(folder / f"{name}.csv", simulate(plant, motion, 15.0, 200.0, rng))
    paths = [str(folder / name) for name in ("arm.toml", "train.csv", "hold.csv", "out.json")]
    assert main(["diagnose", *paths[:2], "--holdout", paths[2], "--json", paths[3]]) == 0
    return value, json.loads((folder / "out.json").read_text())["effects"]


def named(effects):
    return {(e["name"], e["at"]) for e in effects}


def parameters(effects, name, at):
    (effect,) = [e for e in effects if (e["name"], e["at"]) == (name, at)]
    return {k: v["value"] for k, v in effect["parameters"].items()}


def stop(ways):
    """Twice the disturbance at the joint, beside a constant."""
    where = float(min(np.quantile(way, 0.7) for way in ways))
    pressed = np.maximum(ways[0] - where, 0)
    return "stop", Stop(float(2 * RMS / np.std(pressed)), where)


def spring(ways):
    middle = float(np.mean(ways[0]))
    return "harness", Harness(float(2 * RMS / np.std(ways[0])), middle)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [211, 212, 213])
def test_a_stop_is_named_with_its_place(tmp_path, seed):
    true, found = diagnosed(tmp_path, seed, stop)
    assert named(found) == {("end_stop", "joint2")}
    values = parameters(found, "end_stop", "joint2")
    assert values["where"] == pytest.approx(true.where, abs=0.1)
    assert values["above"] == pytest.approx(true.stiffness, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [211, 212, 213])
def test_a_spring_is_no_stop(tmp_path, seed):
    true, found = diagnosed(tmp_path, seed, spring)
    assert named(found) == {("harness_stiffness", "joint2")}
    assert parameters(found, "harness_stiffness", "joint2")["stiffness"] == pytest.approx(true.stiffness, rel=0.2)
