"""Rotations as expressions, against SciPy's."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from snarelab.models.rotation import quaternion_of, quaternion_rate, rotation_of, turn

HALVES = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), -np.eye(3)]))
TURNS = [*Rotation.random(40, np.random.default_rng(3)), *HALVES]
"""At random, and half turns about each axis, where w is zero."""


def value(expression):
    return np.array(ca.DM(ca.evalf(expression)))


@pytest.mark.parametrize("turned", TURNS)
def test_a_quaternion_is_that_of_its_matrix_and_has_no_negative_w(turned):
    found = value(quaternion_of(ca.SX(turned.as_matrix())))[:, 0]
    assert found[0] >= 0
    assert abs(found @ turned.as_quat(scalar_first=True)) == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(value(rotation_of(ca.SX(3 * found))), turned.as_matrix(), atol=1e-12)


def test_a_turn_about_an_axis():
    axis = np.array([2.0, -1.0, 2.0]) / 3
    np.testing.assert_allclose(value(turn(axis, ca.SX(0.7))), Rotation.from_rotvec(0.7 * axis).as_matrix(), atol=1e-12)


def test_a_quaternion_turns_at_its_spin_in_the_turning_frame():
    start, spin, h = Rotation.random(rng=np.random.default_rng(4)), np.array([0.3, -1.2, 0.8]), 1e-6
    ends = [(start * Rotation.from_rotvec(sign * h * spin)).as_quat(scalar_first=True) for sign in (1, -1)]
    wanted = (ends[0] - ends[1]) / (2 * h)
    rate = value(quaternion_rate(ca.SX(start.as_quat(scalar_first=True)), ca.SX(spin)))[:, 0]
    np.testing.assert_allclose(rate, wanted, atol=1e-8)
