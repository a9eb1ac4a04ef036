"""Friction over speed: its parts, and the points measured, on a pendulum simulated by another hand than the fit's."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pendulum import recorded

from snarelab.identification.fitting.friction_curve import friction_curves
from snarelab.identification.identify import identify


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """A joint with 3 N·m of dry friction, 2 N·m·s/rad of viscous, and drag of 1.5 N·m·s²/rad² that the model has no law
    for."""
    folder = tmp_path_factory.mktemp("curve")
    return identify(recorded(folder, 3, drag=1.5), [folder / "train.csv"])


@pytest.fixture(scope="module")
def curve(identified):
    (found,) = json.loads(json.dumps(identified.to_json()))["curves"]
    return {k: [np.array(part) for part in v] if k == "parts" else v for k, v in found.items()}


def test_parts_add_up_to_the_curve_in_the_order_of_their_names(curve):
    assert curve["effects"] == ["viscous_friction", "coulomb_friction"]
    viscous, coulomb = curve["parts"]
    np.testing.assert_allclose(viscous + coulomb, curve["value"])
    speed = np.array(curve["speed"])
    np.testing.assert_allclose(viscous / viscous[-1], speed / speed[-1], atol=1e-9)
    fast = np.abs(speed) > 0.2 * speed.max()
    np.testing.assert_allclose(np.abs(coulomb[fast]), np.abs(coulomb[-1]), rtol=1e-3)


def test_points_are_what_was_measured_and_not_the_fitted_laws(curve):
    """They lie on the friction that the joint has, its drag too, while the two fitted laws cannot."""
    speed, value, std = (np.array(curve["measured"][k]) for k in ("speed", "value", "std"))
    moving = np.abs(speed) > 0.15
    has = 3.0 * np.sign(speed) + 2.0 * speed + 1.5 * speed * np.abs(speed)
    fitted = np.interp(speed, curve["speed"], curve["value"])
    off = np.sqrt(np.mean((value - has)[moving] ** 2))
    assert off < 0.3  # the disturbance
    assert off < 0.25 * np.sqrt(np.mean((fitted - has)[moving] ** 2))
    assert np.all(std[moving] > 0.02)


def test_samples_that_are_no_data_are_no_points(identified):
    """Nor is a joint whose torque nobody recorded: its residual is none."""
    (e,) = identified.train
    speed = e.motion.to_band(e.motion.qd)
    fast = speed > 1.0
    (some,) = friction_curves(identified.fit, [replace(e, kept=~fast)])
    assert some.measured is not None
    assert 0.8 < some.measured[0].max() < 1.0
    (none,) = friction_curves(identified.fit, [replace(e, motion=replace(e.motion, silent=(0,)))])
    assert none.measured is None
