"""Beside a whole friction law, what changes the law's shape is named, and what the law has wrong by itself is not."""

import numpy as np
import pytest

from snarelab.identification.diagnose import diagnose
from snarelab.models.model_file import load_model

INERTIA, LEVEL, VISCOUS, NOISE = 5.0, 20.0, 8.0, 0.02


def record(path, seed, seconds, bump):
    """A wheel that rubs with two exponential bumps over speed (Bo and Pavelescu's law), which no tanh has."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, 1 / 200)
    w, phase = 2 * np.pi * np.array([0.05, 0.11, 0.23]), rng.uniform(0, 2 * np.pi, 3)
    turn = w * t[:, None] + phase
    q, qd, qdd = (x.sum(axis=1) for x in (0.57 / w * np.sin(turn), 0.57 * np.cos(turn), -0.57 * w * np.sin(turn)))
    level = LEVEL + 10.0 * np.exp(-((qd / 0.02) ** 2)) + bump * np.exp(-((qd / 0.2) ** 2))
    tau = INERTIA * qdd + np.tanh(qd / 2e-3) * level + VISCOUS * qd + NOISE * rng.normal(size=len(t))
    table = np.column_stack([t, q, tau])
    np.savetxt(path, table, delimiter=",", header="time,q.joint1,tau.joint1", comments="", fmt="%.9g")


@pytest.mark.slow
@pytest.mark.parametrize(("bump", "verdict"), [(0.0, "adequate"), (8.0, "missing_physics")])
def test_a_change_of_shape_is_named(tmp_path, bump, verdict):
    own = f'<inertial><mass value="1"/><inertia ixx="5" ixy="0" ixz="0" iyy="5" iyz="0" izz="{INERTIA}"/></inertial>'
    (tmp_path / "wheel.urdf").write_text(
        f'<robot name="wheel"><link name="base"/><link name="link1">{own}</link><joint name="joint1" type="revolute">'
        '<parent link="base"/><child link="link1"/><axis xyz="0 0 1"/>'
        '<limit lower="-9" upper="9" velocity="5" effort="200"/></joint></robot>'
    )
    (tmp_path / "wheel.toml").write_text(
        'name = "wheel"\nsystem = "arm"\nurdf = "wheel.urdf"\neffects = ["makkar_friction"]\n'
    )
    record(tmp_path / "train.csv", 1, 60.0, bump)
    record(tmp_path / "hold.csv", 2, 40.0, bump)
    found = diagnose(load_model(tmp_path / "wheel.toml"), [tmp_path / "train.csv"], tmp_path / "hold.csv").diagnosis
    assert found.verdict == verdict
    before = found.fit[0].train
    assert before.rms_before > 1.4 * NOISE  # something is left in either case
    assert [(e.name, e.at) for e in found.effects] == ([("stribeck_friction", "joint1")] if bump > 1 else [])
