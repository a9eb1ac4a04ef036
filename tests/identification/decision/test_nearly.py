"""A curve that a name nearly is does not stand in for the name where the name is tried."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.decision import nearly
from snarelab.identification.decision.nearly import without_its_curves

SHAPE = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 5.0]])
"""What a name adds along three samples, and what it cannot."""

KIND: Any = SimpleNamespace(residuals=lambda fit: [fit])
"""One whose fit is what it leaves of one recording."""


@dataclass(frozen=True)
class Found:
    weighed: Any
    search: Any
    slots: tuple[Any, ...]


def found(beside, own=1.0, channel=0) -> tuple[Found, Any, Any]:
    """A curve that adds ``beside``, a law, and fits with a name that adds ``own`` times its shape, and without it."""
    identity = SimpleNamespace(solve=lambda x: x)
    evidence = SimpleNamespace(channels=[[SimpleNamespace(covariance=identity)] * 2], items=["curve", "law"])
    pool = [SimpleNamespace(named=False, label=(channel, None)), SimpleNamespace(named=True, label=None)]
    slots = tuple(SimpleNamespace(taken=SimpleNamespace(hypothesis=k, item=k, size=1.0)) for k in (0, 1))
    leaves = [np.stack([x * SHAPE[0], np.zeros(3)], 1) for x in (0.0, own)]
    search = SimpleNamespace(on=SimpleNamespace(added=lambda *_: beside))
    return Found(SimpleNamespace(evidence=evidence, pool=pool), search, slots), leaves[0], leaves[1]


@pytest.fixture(autouse=True)
def amplitudes(monkeypatch):
    monkeypatch.setattr(nearly, "Members", lambda *_: SimpleNamespace(of=lambda _: None))


@pytest.mark.parametrize(
    ("beside", "kept"),
    [
        (0.2 * SHAPE[0], False),  # more of the same
        (0.5 * SHAPE[1], False),  # 1 : 1/2, the name is 80 % of the sum
        (0.6 * SHAPE[1], True),  # 1 : 0.6, it is 74 %
        (-3.0 * SHAPE[0], True),  # the curve takes it back
    ],
)
def test_a_curve_goes_where_the_name_is_nearly_all(beside, kept):
    made, final, rest = found(beside)
    left: Any = without_its_curves(KIND, made, (0,), final, rest)  # pyright: ignore[reportArgumentType]
    assert [s.taken.hypothesis for s in left.slots] == ([0, 1] if kept else [1])
    assert (left is made) is kept


def test_curves_of_other_channels_stay():
    made, final, rest = found(0.2 * SHAPE[0], channel=1)
    assert without_its_curves(KIND, made, (0,), final, rest) is made  # pyright: ignore[reportArgumentType]


def test_a_name_that_adds_nothing_is_no_part_of_a_curve():
    made, final, rest = found(SHAPE[1], own=0.0)
    assert without_its_curves(KIND, made, (0,), final, rest) is made  # pyright: ignore[reportArgumentType]
