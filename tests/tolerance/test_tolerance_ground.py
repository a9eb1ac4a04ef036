"""One case of a tolerance study: whether the pin is inside, from shapes that are known, and two whole captures."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.models.snare.parameters import SnareParameters
from snarelab.tolerance import ground
from snarelab.tolerance.enclosure import encloses, radial_error
from snarelab.tolerance.ground import CAPTURE, run

P = SnareParameters()
NOMINAL = {a.name: a.nominal for a in CAPTURE.axes}


def history(pins, sag=0.0) -> Any:
    """Cables along the rings' wall at first, then drawn in by ``sag`` of the radius; a pin's foot at each time."""
    cables = []
    for drawn in (0.0, sag):
        shape = []
        for cable in range(3):
            turn = 2 * np.pi / 3 * (1 - cable + P.ring_direction * np.linspace(0, 1, 21))
            radius = P.ring_radius * (1 - drawn * np.sin(np.linspace(0, np.pi, 21)))
            along = np.linspace(0, P.ring_distance, 21)
            shape.append(np.column_stack([along, radius * np.cos(turn), radius * np.sin(turn)]))
        cables.append(shape)
    return SimpleNamespace(
        cables=np.array(cables), target_position=np.array(pins, float), target_quaternion=np.array([[1.0, 0, 0, 0]] * 2)
    )


@pytest.mark.parametrize(
    ("pins", "sag", "inside"),
    [
        ([[0.2, 0.0, 0.0]] * 2, 0.0, True),
        ([[0.2, 0.05, -0.03]] * 2, 0.5, True),
        ([[0.2, 0.14, 0.0]] * 2, 0.5, False),  # never was inside the rings
        ([[0.2, 0.05, 0.0], [0.2, -0.110, 0.0]], 0.9, False),  # a cable was drawn in over it
        ([[0.2, 0.0, 0.0], [0.2 + P.pin_length, 0.0, 0.0]], 0.5, False),  # drawn out along the axis
    ],
)
def test_a_pin_is_inside_where_the_cables_wind_around_it(pins, sag, inside):
    assert encloses(history(pins, sag), P) is inside


def test_radial_error_is_the_larger_displacement():
    assert radial_error(history([[0.2, 0.0, 0.0], [0.2, 0.004, -0.007]])) == 0.007


def test_the_papers_capture_succeeds_and_a_miss_is_one():
    caught = run({**NOMINAL, "radial_y": 0.0747, "radial_z": 0.0402, "roll": 0.069, "pitch": -0.015, "yaw": -0.022})
    assert caught.enclosed
    assert 2.0 < caught.first_contact < 3.2
    assert caught.radial_error < 0.010
    assert 0 < caught.peak_force < caught.peak_tension * 3 < 1e4
    missed = run({**NOMINAL, "radial_y": 0.16})
    assert not missed.enclosed
    assert np.isnan(missed.first_contact)


def test_the_end_is_the_papers_and_judged_after_the_wait(monkeypatch):
    assert pytest.approx(P.ring_travel / P.ring_rate) == ground.DURATION
    monkeypatch.setattr(ground, "DURATION", 0.1)
    assert ground.simulate({**NOMINAL, "wait": 0.06}).times[-1] == pytest.approx(0.16, abs=1e-12)
