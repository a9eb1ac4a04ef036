"""Which point of an effect's grid stands for it: what explains most, the middle where nothing does, none where the
baseline can mimic every point."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import trial
from snarelab.identification.search.candidates import Variant
from snarelab.identification.search.evidence import Gain
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed


@pytest.mark.parametrize(
    ("gains", "best"),
    [
        ([0.0, 0.0, 0.0, 0.0, 0.0], 2),
        ([0.0, 0.0, 0.0, 0.0, 3.0], 4),
        ([0.0, 5.0, None, 0.0, 3.0], 1),
        ([0.0, None, None, None, None], 0),
        ([None] * 5, None),
    ],
)
def test_the_point_that_stands_for_an_effect(monkeypatch, gains, best):
    """Five points of a grid; None is one that the baseline can mimic. All others count among what noise reaches."""
    entered = []
    placed = Placed(get_effect("viscous_friction"), "joint1")
    variants = [Variant(placed, np.array([float(k)]), np.array([0]), np.zeros(1), np.ones(1)) for k in range(5)]

    def case(k):
        gain = Gain(gains[k] or 0.0, np.zeros(1), 1.0, mimicked=gains[k] is None)
        made: Any = Made(gain=lambda: gain, reached=(0,), own=k)
        made.only = lambda _: made
        return made

    samples: Any = Made(
        cases=lambda options: [case(k) for k in range(len(options))],
        explained=lambda *_: 0.0,
        evidence=Made(null_gains=lambda own: np.array([own])),
    )
    ground: Any = Made(
        asked=Made(evidence=Made(size=100)),
        noise=Made(whiten=lambda c, parts: parts[0]),
        readings=Made(everywhere=Made(columns=None)),
    )
    monkeypatch.setattr(trial._Judge, "_price", lambda *_: 1.0)
    null: Any = Made(enter=lambda reached, scores: entered.append(int(scores[0] + 1)))
    found = trial._Judge(ground)(samples, [(v, {0: [np.ones((4, 1))]}) for v in variants], null)
    assert sorted(entered) == [k for k in range(5) if gains[k] is not None]
    assert (None if found is None else int(found.variant.parameters[0])) == best
    if found is not None and best is not None:
        assert found.score == gains[best] - 1.0
