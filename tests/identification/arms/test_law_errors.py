"""What a law of the model has wrong stands beside every explanation, at every joint that feels it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.arms.beside.force import error_of_force
from snarelab.identification.deciding import LAW_ERROR
from snarelab.identification.fitting.assembly import TorqueModel
from snarelab.identification.fitting.experiment import Experiment, scales
from snarelab.identification.nuisance.curve import TURNING, Coordinates, over_decades
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
    time = np.asarray(0.01 * np.arange(N), np.float64)
    w = np.asarray(1.0 + 0.3 * np.arange(7), np.float64)
    q = 0.2 * np.sin(time[:, None] * w)
    qd, qdd = 0.2 * w * np.cos(time[:, None] * w), -(w**2) * q
    names = tuple(j.name for j in rig.joints)
    whole, still = (slice(0, N),), np.full_like(q, 20.0)
    return Experiment(
        Motion("run.csv", names, 0.01, 50.0, time, q, qd, qdd, np.ones_like(q), still, whole, 1, (), np.zeros((3, 7))),
        RigidBody(rig),
    )


def coordinates(e, c, speed=None):
    """Of a joint, or at other speeds of it."""
    peak = float(np.abs(e.motion.qd[:, c]).max())
    found = Coordinates.along(e.motion, np.zeros(N), c, peak, float(np.ptp(e.motion.q[:, c])))
    if speed is None:
        return found
    return replace(found, speed=speed / peak, direction=np.tanh(speed / (TURNING * peak)))


def test_error_of_a_slide_s_friction_is_felt_before_the_slide_in_proportion(turning):
    """Two contacts are a couple: upright joints before the slide feel it by their angle to its axis."""
    placed = PlacedEffect(get_effect("slide_friction"), f"joint{JOINT + 1}")
    values = {f"{placed.key}.{p.name}": 0.0 for p in placed.effect.parameters}
    values |= {f"{placed.key}.{k}": v for k, v in (("coulomb_level", 60.0), ("coulomb_speed", 0.03))}
    values |= {f"{placed.key}.{k}": v for k, v in (("stribeck_speed", 0.01), ("stribeck_ratio", 4.0))}
    assembly = TorqueModel(turning.body.tree, [placed], None, scales([turning]), values)
    found: Any = SimpleNamespace(assembly=assembly, theta=assembly.start)
    bare = TorqueModel(turning.body.tree, [], None, scales([turning]), {})
    law = assembly.torque(turning, assembly.start) - bare.torque(turning, bare.start)
    along: Any = SimpleNamespace(instruments=[turning], n_train=1, coordinates=lambda c: [coordinates(turning, c)])
    (errors,) = error_of_force(along, found, placed)
    assert [c for c, _ in errors] == [0, 2, 3]
    rms = np.sqrt(np.mean(turning.motion.to_band(law)[:, JOINT] ** 2))
    for c, x in errors:
        np.testing.assert_allclose(x, errors[-1][1] * law[:, [c]] / law[:, [JOINT]], atol=1e-9 * rms)
    assert np.sqrt(np.mean(np.sum(errors[-1][1] ** 2, axis=1))) == pytest.approx(LAW_ERROR * rms)


def test_error_near_rest_is_told_apart_from_that_in_motion(turning):
    """A tenth of a decade is alike, a decade is not, and the curve is of about unit variance at all of them."""
    peak = float(np.abs(turning.motion.qd[:, JOINT]).max())
    speed = peak * np.array([0.01, 0.012, 0.1, 1.0])
    x = over_decades(coordinates(turning, JOINT, speed))
    like = x @ x.T / np.sqrt(np.outer(*[np.sum(x**2, axis=1)] * 2))
    assert like[0, 1] > 0.95
    assert max(like[0, 2], like[2, 3]) < 0.6
    size = np.sum(x**2, axis=1) / np.tanh(speed / (TURNING * peak)) ** 2
    assert np.all((size > 0.6) & (size < 1.4))  # the basis falls towards the ends of its range
