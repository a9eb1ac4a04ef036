"""Torques of another engine along motion that nothing disturbs: pinocchio's inverse dynamics, laws written out here.

The motion is exact but for the encoders' steps, so that all the fast acceleration a reader sees is noise.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest

from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

pin: Any = pinocchio  # its stubs lack most names
ARM = Path(__file__).resolve().parents[2] / "studies" / "bundled" / "arm3.urdf"
RATE, STEP = 200.0, 2e-5
COULOMB, VISCOUS = np.array([3.0, 4.0, 2.0]), np.array([4.0, 5.0, 2.0])
JOINT = 1
LATE = 0.02


def motion(seed, seconds, still=()):
    """Time (n,), and position, rate and acceleration (n, 3): five harmonics of 0.1 Hz for each joint but the still."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    k = np.arange(1, 6)[:, None]
    w, size = 2 * np.pi * 0.1 * k, rng.normal(0, 0.35, (5, 3)) / np.sqrt(k)
    angle = np.einsum("k,n->nk", w[:, 0], time)[:, :, None] + rng.uniform(0, 2 * np.pi, (5, 3))
    centre = rng.uniform(-0.4, 0.4, 3)
    size[:, still] = centre[list(still)] = 0.0
    return (
        time,
        centre + np.sum(size * np.sin(angle), 1),
        np.sum(size * w * np.cos(angle), 1),
        -np.sum(size * w**2 * np.sin(angle), 1),
    )


def inverse(arm, *motion):
    data = arm.createData()
    return np.array([pin.rnea(arm, data, *row) for row in zip(*motion, strict=True)])


def recording(path, seed, concealed, seconds, still=()):
    """A recording with 1 % of noise on every torque, and one thing that the model leaves out."""
    arm = pin.buildModelFromUrdf(str(ARM))
    time, q, qd, qdd = motion(seed, seconds, still)
    if concealed == "inertia_error":
        arm.inertias[3] = pin.Inertia(1.4 * arm.inertias[3].mass, arm.inertias[3].lever, 1.4 * arm.inertias[3].inertia)
    rigid = inverse(arm, q, qd, qdd)
    torque = rigid + COULOMB * np.tanh(qd / 1e-3) + VISCOUS * qd
    seen = q.copy()
    if concealed == "rotor_inertia":
        torque[:, JOINT] += 2.0 * qdd[:, JOINT]
    if concealed == "joint_elasticity":
        seen[:, JOINT] += rigid[:, JOINT] / 4000.0
    if concealed == "late torque":
        torque[:, JOINT] = np.interp(time - LATE, time, torque[:, JOINT])
    if concealed == "late drive":
        torque[:, JOINT] = np.interp(time + LATE, time, torque[:, JOINT])
    if concealed == "late encoder":
        seen[:, JOINT] = np.interp(time - LATE, time, q[:, JOINT])
    rng = np.random.default_rng(seed + 100)
    torque += 0.01 * torque.std(0) * rng.normal(size=torque.shape)
    header = ["time", *(f"{kind}.joint{j}" for kind in ("q", "tau") for j in (1, 2, 3))]
    table = np.column_stack([time, np.round(seen / STEP) * STEP, torque])
    np.savetxt(path, table, delimiter=",", header=",".join(header), comments="", fmt="%.9g")
    return path


def diagnosed(folder, concealed, still=(), seconds=12.0):
    model = folder / "arm.toml"
    model.write_text(
        f'name = "arm"\nsystem = "arm"\nurdf = "{ARM}"\ngravity = [0.0, 0.0, -9.81]\ninertia = "fixed"\n'
        'effects = ["coulomb_friction", "viscous_friction"]\n'
    )
    parts = (("train", 1), ("held", 2))
    train, held = (recording(folder / f"{name}.csv", seed, concealed, seconds, still) for name, seed in parts)
    return diagnose(load_model(model), [train], held).diagnosis


def test_noise_of_the_encoders_is_no_spring(tmp_path):
    """It is most of what is left over, and a spring, which keeps the link from following it, takes a fifth of it."""
    found = diagnosed(tmp_path, "nothing")
    assert found.verdict == "adequate", found.sentence


@pytest.mark.parametrize(
    ("concealed", "name", "at", "parameter", "value", "error", "seconds"),
    [
        ("rotor_inertia", "rotor_inertia", "joint2", "inertia", 2.0, 0.1, 12.0),
        ("joint_elasticity", "joint_elasticity", "joint2", "stiffness", 4000.0, 0.1, 12.0),
        # Coulomb friction is a step, which the delay's two states turn over gradually.
        pytest.param(*("late torque", "sensor_delay", "tau.joint2", "delay", LATE, 0.15, 12.0), marks=pytest.mark.slow),
        pytest.param(*("late drive", "command_delay", "tau.joint2", "delay", LATE, 0.15, 12.0), marks=pytest.mark.slow),
        ("late encoder", "sensor_delay", "q.joint2", "delay", LATE, 0.15, 12.0),
        pytest.param(*("inertia_error", "inertia_error", "link3", "mass", None, 0.15, 24.0), marks=pytest.mark.slow),
    ],
)
def test_named_placed_and_nothing_else(concealed, name, at, parameter, value, error, seconds, tmp_path):
    found = diagnosed(tmp_path, concealed, seconds=seconds)
    (only,) = found.effects
    # All of a link's mass properties scaled by one factor are nearly a mass put at one point.
    alike = {(only.name, only.at), *((r.name, r.at) for r in only.rivals if not r.separable)}
    assert (name, at) in alike, found.sentence
    assert only.probability > 0.5
    wanted = value or 0.4 * pin.buildModelFromUrdf(str(ARM)).inertias[3].mass
    assert only.parameters[parameter].value == pytest.approx(wanted, rel=error)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("joint", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_a_joint_that_stands_at_exactly_zero_is_no_obstacle(tmp_path, joint):
    found = diagnosed(tmp_path, "rotor_inertia", [joint])
    (only,) = found.effects
    assert (only.name, only.at) == ("rotor_inertia", "joint2"), found.sentence
    assert only.parameters["inertia"].value == pytest.approx(2.0, rel=0.1)
