"""Make the bundled recording again: ``python studies/bundled/generate.py [FOLDER]`` (needs mujoco)."""

import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.append(str(Path(__file__).resolve().parents[2]))

from bench.arm import Arm, random_arm
from bench.lugre import LuGre
from bench.motion import fourier_motion, point_to_point_motion
from bench.mujoco_plant import Plant, simulate, write_csv
from bench.parts import Disturbance, Servo

SEED = 23
RATE = 200.0
DURATION = {"train": 20.0, "holdout": 12.0}

MODEL = """\
name = "arm3"
system = "arm"
urdf = "arm3.urdf"
gravity = [0.0, 0.0, -9.81]
inertia = "fixed"
effects = ["viscous_friction"]
"""

ANSWER = {
    "effects": [
        {"name": "coulomb_friction", "at": "joint1", "parameters": {"level": {"value": 9.0, "unit": "N*m"}}},
        {"name": "coulomb_friction", "at": "joint2", "parameters": {"level": {"value": 7.0, "unit": "N*m"}}},
        {"name": "coulomb_friction", "at": "joint3", "parameters": {"level": {"value": 4.0, "unit": "N*m"}}},
        {
            "name": "stribeck_friction",
            "at": "joint2",
            "parameters": {
                "level": {"value": 6.0, "unit": "N*m"},
                "speed": {"value": 0.1, "unit": "rad/s"},
            },
        },
        *(
            {
                "name": "presliding_hysteresis",
                "at": joint,
                "parameters": {"travel": {"value": 1e-4, "unit": "rad"}},
            }
            for joint in ("joint1", "joint2", "joint3")
        ),
        {"name": "sensor_delay", "at": "tau.joint1", "parameters": {"delay": {"value": 0.006, "unit": "s"}}},
    ],
    "known_to_the_model": {"viscous_friction": {"joint1": 6.0, "joint2": 5.0, "joint3": 2.0, "unit": "N*m*s/rad"}},
    "noise": "torque sensor 0.15 N*m RMS, process torque 0.2 N*m RMS in 0.3..15 Hz, encoder quantum 2*pi/2^20 rad",
    "law": "LuGre, bristle deflection 1e-4 rad: friction near rest is a stiff spring, not a step",
}


def arm3() -> Arm:
    """The arm: its URDF is exact, nothing is wrong with its masses."""
    return random_arm(np.random.default_rng(SEED), 3)


def plant(arm: Arm) -> Plant:
    """What the model file does not say."""
    return Plant(
        arm,
        friction={
            "joint1": LuGre(level=9.0, viscous=6.0, deflection=1e-4),
            "joint2": LuGre(level=7.0, static=13.0, stribeck_speed=0.1, viscous=5.0, deflection=1e-4),
            "joint3": LuGre(level=4.0, viscous=2.0, deflection=1e-4),
        },
        disturbance={joint: Disturbance(0.2) for joint in arm.joints},
        encoder_step={joint: 2.0 * np.pi / 2**20 for joint in arm.joints},
        tau_noise={joint: 0.15 for joint in arm.joints},
        tau_delay={"joint1": 0.006},
        servo=Servo(bandwidth=7.0),
    )


def record(part: str) -> dict[str, NDArray]:
    """The recording ``"train"`` or ``"holdout"``: other motions, other noise, the same plant."""
    arm = arm3()
    moving, measuring = np.random.default_rng([SEED, list(DURATION).index(part)]).spawn(2)
    if part == "train":
        motion = fourier_motion(arm, moving, DURATION[part], highest=0.7)
    else:
        motion = point_to_point_motion(arm, moving, DURATION[part], slowest=0.3, dwell=0.0)
    return simulate(plant(arm), motion, DURATION[part], RATE, measuring)


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm3.urdf").write_text(arm3().urdf("arm3"))
    (folder / "arm3.toml").write_text(MODEL)
    (folder / "answer.json").write_text(json.dumps(ANSWER, indent=2) + "\n")
    for part in DURATION:
        write_csv(folder / f"{part}.csv", record(part))
