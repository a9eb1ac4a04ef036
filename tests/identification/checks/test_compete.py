"""What a reading explains is counted on recorded torques, whichever joints it gives them to."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.checks import compete
from snarelab.identification.checks.reading import as_read

GIVEN = np.array([0.23, 0.06, 0.01])
SWAPPED = as_read(3).but(name="swapped", at=("tau.a", "tau.b"), message="exchanged", mends=("1", "2"))


def found(relative: list[float], order: list[int]) -> list:
    """Findings where a reading that gives torques in some order is sure, and leaves these errors."""
    case: Any = SimpleNamespace(joints=("a", "b", "c"), given=SimpleNamespace(relative=GIVEN, prior=0.0))
    case.reading = lambda *_: as_read(3)
    fit: Any = SimpleNamespace(relative=np.array(relative), prior=0.0)
    score = compete.ReadingScore(SWAPPED.but(torque_source=np.array(order)), fit, 50.0)
    return compete.findings(case, [score])


@pytest.fixture(autouse=True)
def within(monkeypatch):
    monkeypatch.setattr(compete, "beyond_limits", lambda *_: "")


def test_errors_that_move_along_with_the_torques_are_not_explained():
    """A torque that no model explains well is no better explained at another joint."""
    assert not found([0.051, 0.24, 0.01], [1, 0, 2])


def test_errors_that_fall_are_compared_with_those_of_the_same_torque():
    first, second = found([0.03, 0.02, 0.01], [1, 0, 2])
    assert (first.at, second.at) == ("tau.a", "tau.b")
    assert "tau.b falls from 23 % to 2.0 %" in first.message


def test_the_same_torques_are_compared_joint_by_joint():
    (first, _) = found([0.02, 0.06, 0.01], [0, 1, 2])
    assert "tau.a falls from 23 % to 2.0 %" in first.message
