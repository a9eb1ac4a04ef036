"""Which names of a best set are fitted together, and which wait."""

from types import SimpleNamespace as Made
from typing import Any

import pytest

from snarelab.identification.arms.choice import together
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

LAWS = (("viscous_friction", "joint1"), ("sensor_bias", "tau.joint2"), ("sensor_delay", "tau.joint3"))


def chosen(gains, alone, whole=1000.0, named=(True, True, True)) -> list[int]:
    """Of three laws with these gains: the set's log Bayes factor is ``whole``, so that 0.02² of it is 0.4."""
    pool = [Made(named=n, label=PlacedEffect(get_effect(x), at)) for n, (x, at) in zip(named, LAWS, strict=True)]
    made: Any = Made(pool=pool, members=lambda _: Made(value=whole), scan=lambda _: Made(odds=alone))
    slots: Any = [Made(gain=g, taken=Made(hypothesis=k)) for k, g in enumerate(gains)]
    found = together(made, slots, slots)
    assert all(beside is slots for _, beside in found)
    return [s.taken.hypothesis for s, _ in found]


@pytest.mark.parametrize(
    ("gains", "alone", "wanted"),
    [
        ((900.0, 5.0, 5.0), (800.0, 3.0, 3.0), [0, 1, 2]),
        ((900.0, 0.39, 0.41), (800.0, 3.0, 3.0), [0, 2]),  # what is less than a law's error waits
        ((0.3, 0.2, 0.1), (3.0, 2.0, 1.0), [0, 1, 2]),  # where nothing is larger, nothing waits
        ((5.0, 5.0, 900.0), (3.0, 2.0, 800.0), [2]),  # what lags is fitted by itself
    ],
)
def test_large_names_are_fitted_together(gains, alone, wanted):
    assert chosen(gains, alone) == wanted


def test_a_nameless_curve_is_not_fitted():
    assert chosen((900.0, 5.0, 5.0), (1.0, 1.0, 0.0), named=(False, True, False)) == [1]
    assert chosen((900.0, 5.0, 5.0), (1.0, 1.0, 0.0), named=(False, False, False)) == []
