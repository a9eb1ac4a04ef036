"""Impulses that a snare gives, against closed forms: cables that gain nothing hand on what they get."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.cosim.participants import snare_impulses
from snarelab.cosim.participants.snare_impulses import ImpulseSnareParticipant
from snarelab.models.snare.parameters import SnareParameters

EFFECTOR, FOOT = np.array([0.1, -0.2, 0.3]), np.array([0.4, 0.1, -0.2])
GIVEN = np.array([[1.0, 0.5, -0.5, 0.2, 0.0, 0.1], [3.0, 0.0, -2.0, 0.5, -0.3, 0.4], [4.0, 2.0, -1.0, 0.7, 0.6, 0.9]])
"""Impulse and moment about its foot that the pin has got in all [N·s, N·m·s], at the start and after each step."""


class Stand:
    """A model whose bodies stand still; by now its pin has got ``GIVEN``, and its cables have ``momentum`` (3, 6)."""

    origin = np.zeros(3)
    ring_angle = 0.0

    def __init__(self, momentum):
        self.taken, self._momentum = 0, momentum

    @property
    def assembly(self):
        return Made(pin=np.array([FOOT]), momentum=self._momentum[self.taken])

    def step(self, _size):
        self.taken += 1

    def move_effector(self, _pose):
        pass

    move_target = move_effector

    def pin_impulse(self):
        return GIVEN[self.taken].copy()

    def effector_pose(self):
        return Made(position=EFFECTOR)

    def wrenches(self):
        return np.zeros(6), np.zeros(6)

    def energies(self):
        return dict.fromkeys(snare_impulses._ENERGIES, 0.0)


@pytest.mark.parametrize("gained", [(0.0,) * 6, (0.5, -1.0, 2.0, 0.3, 0.2, -0.1)], ids=["nothing", "some"])
def test_the_effector_gets_what_neither_pin_nor_cables_keep(monkeypatch, gained):
    """Momentum and its moment about the world's origin add up to nothing over two steps of 1 ms."""
    monkeypatch.setattr(snare_impulses, "momentum", lambda assembly: assembly.momentum)
    model: Any = Stand(np.outer([0.0, 0.4, 1.0], gained))
    snare = ImpulseSnareParticipant(SnareParameters())
    snare.initialize()
    snare._model = model
    for k in range(2):
        snare.step(1e-3 * k, 1e-3)
    shown = dict(zip(snare.names("output"), snare.outputs(), strict=True))

    def of(kind, body):
        return np.array([shown[f"{kind}.{body}.{axis}"] for axis in "xyz"])

    on_pin, turned = np.split(GIVEN[2] - GIVEN[0], 2)
    on_effector = of("impulse", "effector")
    np.testing.assert_allclose(on_effector + on_pin + gained[:3], 0.0, atol=1e-12)
    about_origin = of("angular_impulse", "effector") + np.cross(EFFECTOR, on_effector) + turned + np.cross(FOOT, on_pin)
    np.testing.assert_allclose(about_origin + gained[3:], 0.0, atol=1e-12)
    np.testing.assert_array_equal(np.concatenate([of("impulse", "pin"), of("angular_impulse", "pin")]), GIVEN[2])
