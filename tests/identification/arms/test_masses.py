"""The tolerance of masses: every inertial parameter by itself, and every link as a whole."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moving_arm import build, motion, three_joints

from snarelab.identification.arms.beside.masses import blocks
from snarelab.identification.fitting.experiment import Experiment
from snarelab.models.rigid_body import RigidBody
from snarelab.models.urdf import load_urdf

KINDS = ("revolute", "revolute", "prismatic")


@pytest.fixture
def arm(tmp_path):
    return three_joints(tmp_path)


def denser(folder, link: str, factor: float):
    """Rigid body of the arm's URDF with mass and inertia of one link times a factor, its centre where it was."""
    text = (folder / "arm.urdf").read_text()
    own = re.search(rf'<link name="{link}".*?</link>', text, re.DOTALL)
    assert own
    heavier = re.sub(r'((?:value|i[xyz]{2})=")([^"]+)"', lambda m: f'{m[1]}{factor * float(m[2]):.15g}"', own[0])
    (folder / "denser.urdf").write_text(text.replace(own[0], heavier))
    return RigidBody(load_urdf(folder / "denser.urdf", (0.3, -0.2, -9.81)))


def test_a_link_of_another_density_is_one_column(arm, tmp_path):
    """Two thirds denser, as a torque is linear in masses: by the inverse dynamics of another URDF."""
    body = arm[1]
    experiment = Experiment(motion(KINDS), body)
    context: Any = SimpleNamespace(
        along=SimpleNamespace(instruments=[experiment], scale=np.ones(3)),
        found=SimpleNamespace(assembly=build(arm, experiment, [])),
    )
    (block,) = blocks(context)
    assert block.count == 33
    m = experiment.motion
    for number, link in enumerate(arm[0].links):
        more = denser(tmp_path, link.name, 5 / 3)
        extra = more.torque(m.q, m.qd, m.qdd) - body.torque(m.q, m.qd, m.qdd)
        assert np.abs(extra).max() > 0.1
        for c in range(3):
            at, columns = block.parts[0][c]
            own = np.flatnonzero(at == 30 + number)
            seen = columns[:, own].sum(axis=1) * 2 / 3
            assert seen == pytest.approx(experiment.to_band(extra[:, c : c + 1], c)[:, 0], abs=1e-6)
