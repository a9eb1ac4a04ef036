"""Friction over speed: its parts, and the points measured, on a pendulum simulated by another hand than the fit's."""

import json

import numpy as np
import pytest
from pendulum import recorded

from snarelab.identification.identify import identify


@pytest.fixture(scope="module")
def curve(tmp_path_factory):
    """Of a joint with 3 N·m of dry friction, 2 N·m·s/rad of viscous, and drag of 1.5 N·m·s²/rad² that the model has no
    law for."""
    folder = tmp_path_factory.mktemp("curve")
    model = recorded(folder, 3, drag=1.5)
    (found,) = json.loads(json.dumps(identify(model, [folder / "train.csv"]).to_json()))["curves"]
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
