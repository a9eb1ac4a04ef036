"""What a law of the model has wrong stands beside every explanation, at every joint that feels it."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.deciding import LAW_ERROR
from snarelab.identification.evidence import nuisance_columns
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect
from snarelab.models.rig.rig import built_in_rig
from snarelab.models.rigid_body import RigidBody
from snarelab.recordings.condition import Motion

N, JOINT = 400, 3


@pytest.fixture(scope="module")
def turning():
    """All joints of the rig turn as sines of their own."""
    rig = built_in_rig()
    time = 0.01 * np.arange(N)
    w = 1.0 + 0.3 * np.arange(7)
    q = 0.2 * np.sin(time[:, None] * w)
    qd, qdd = 0.2 * w * np.cos(time[:, None] * w), -(w**2) * q
    names = tuple(j.name for j in rig.joints)
    whole, still = (slice(0, N),), np.full_like(q, 20.0)
    return Experiment(
        Motion("run.csv", names, 0.01, 50.0, time, q, qd, qdd, np.ones_like(q), still, whole, 1, (), np.zeros((3, 7))),
        RigidBody(rig),
    )


def test_error_of_a_slide_s_friction_is_felt_before_the_slide_in_proportion(turning):
    """Two contacts are a couple: joints with the same axis before the slide feel all of it, all others nothing."""
    placed = PlacedEffect(get_effect("slide_friction"), f"joint{JOINT + 1}")
    values = {f"{placed.key}.{p.name}": 0.0 for p in placed.effect.parameters}
    values |= {f"{placed.key}.{k}": v for k, v in (("coulomb_level", 60.0), ("coulomb_speed", 0.03))}
    values |= {f"{placed.key}.{k}": v for k, v in (("stribeck_speed", 0.01), ("stribeck_ratio", 4.0))}
    assembly = TorqueModel(turning.body.tree, [placed], None, scales([turning]), values)
    found: Any = SimpleNamespace(assembly=assembly, theta=assembly.start)
    bare = TorqueModel(turning.body.tree, [], None, scales([turning]), {})
    law = assembly.torque(turning, assembly.start) - bare.torque(turning, bare.start)
    shape = law[:, [JOINT]] / law[:, JOINT].max()
    along: Any = SimpleNamespace(instruments=[turning], n_train=1, coordinates=lambda c: [c])
    curve: Any = SimpleNamespace(columns=lambda c: shape if c == JOINT else np.zeros_like(shape))
    (errors,) = nuisance_columns._error_of_force(along, found, placed, curve)
    assert [c for c, _ in errors] == [0, 2, 3]
    for c, x in errors:
        np.testing.assert_allclose(x[:, 0], LAW_ERROR * law[:, c], rtol=0, atol=1e-9 * np.abs(law).max())
