"""Numbers of the answer, halved and doubled: what is confirmed, and what cannot be told apart."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from explained import Explained
from moved_numbers import FACTORS, move, planted

from snarelab.identification.arms.blocks import blocks
from snarelab.identification.decision import confirm as confirming
from snarelab.identification.decision import names
from snarelab.identification.evidence.pool import Hypothesis, Item
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.evidence.search import Search
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def confirmed(monkeypatch, sure: float) -> bool:
    name: Any = SimpleNamespace(placed=PlacedEffect(get_effect("sensor_bias"), "tau.joint1"))
    monkeypatch.setattr(confirming, "loss", lambda *_: confirming.Loss(sure, 1.0, 0.2, 0, None))
    kind: Any = SimpleNamespace(forecast=lambda *_: None, known=lambda *_: None)
    found: Any = SimpleNamespace(names=(name,), last=None)
    return bool(confirming.confirm(kind, found).names)


def test_a_name_is_confirmed_from_two_standard_errors_on(monkeypatch):
    assert [confirmed(monkeypatch, x) for x in (1.2, 1.99, 2.01, 3.8)] == [False, False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "GATE", factor)
            assert confirmed(patch, 1.2) is (factor < 1)
            assert confirmed(patch, 3.8) is (factor < 1)


def test_blocks_of_time(monkeypatch):
    run: Any = SimpleNamespace(motion=SimpleNamespace(band=50.0))
    x = np.ones(3000)
    assert len(blocks(run, x)) == 20
    for factor, count in zip(FACTORS, (40, 10), strict=True):
        with monkeypatch.context() as patch:
            move(patch, "BLOCK", factor)
            assert len(blocks(run, x)) == count


def rivals(share: float, cosine: float) -> list[bool]:
    """Can a rival of this share be told apart, whose column stands at this cosine to the name's?"""
    made = planted(1.0)
    _, x = made.columns.of(0, 0)
    x[:, 1] = cosine * x[:, 0] + np.sqrt(1 - cosine**2) * x[:, 2]
    labels = [SimpleNamespace(amplitudes=[0], count=1), SimpleNamespace(amplitudes=[0], count=1)]
    items = [Item(i.index, i.spread, i.positive, False, y) for i, y in zip(made.items[:2], labels, strict=True)]
    made = Explained(made.pieces, made.columns, items, 0)
    several = [Hypothesis(f"h{k}", True, (i,), -3.0 * k, f"h{k}") for k, i in enumerate(items)]
    run = Search(ProjectedEvidence(made.evidence(), (0,)), several)
    (slot,) = run.answer()
    object.__setattr__(slot, "shares", np.array([1 - share, share, 0.0]))
    return [r.separable for r in names.rivals(run, slot, np.ones(1))]


def test_a_rival_with_a_tenth_of_the_shares_is_not_told_apart(monkeypatch):
    assert [rivals(x, 0.3) for x in (0.06, 0.099, 0.101, 0.19)] == [[True], [True], [False], [False]]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "CLASS", factor)
            assert rivals(0.06, 0.3) == [factor > 1]
            assert rivals(0.19, 0.3) == [factor > 1]


def test_what_adds_the_same_is_alike(monkeypatch):
    """A cosine beyond twice 0.98 there is none: then nothing is alike, and at half of it too much."""
    assert [rivals(0.01, x) for x in (0.6, 0.979, 0.981, 1.0)] == [[True], [True], [False], [False]]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "ALIKE", factor)
            assert rivals(0.01, 0.6) == [factor > 1]
            assert rivals(0.01, 0.99) == [factor > 1]


@pytest.mark.parametrize(("barred", "found"), [((), ["inertia_error"]), ((2,), [])])
def test_a_whole_law_of_two_names_is_a_rival_of_each_though_it_stands_beside_neither(barred, found):
    """A payload and an offset of the centre of mass are parts of an error of all mass properties."""
    made = planted(1.0)
    _, x = made.columns.of(0, 0)
    x[:, 2] = x[:, 0]
    labels = [PlacedEffect(get_effect(name), "link3") for name in ("payload_mass", "com_offset", "inertia_error")]
    one = SimpleNamespace(amplitudes=[0], count=1)
    items = [Item(np.array([k]), np.ones(1), np.zeros(1, bool), False, one) for k in range(3)]
    made = Explained(made.pieces, made.columns, items, 0)
    odds = (0.0, -9.0, -9.0)
    several = [Hypothesis(y.key, True, (i,), x, y) for y, i, x in zip(labels, items, odds, strict=True)]
    run = Search(ProjectedEvidence(made.evidence(), (0,)), several, barred)
    slot = next(s for s in run.answer() if s.taken.hypothesis == 0)
    object.__setattr__(slot, "odds", np.array([slot.odds[0], -np.inf, -np.inf]))
    assert [r.placed.effect.name for r in names.rivals(run, slot, np.ones(1))] == found


def becomes(alike: float) -> bool:
    """Does a curve become the name whose law can add this share of what it adds?"""
    made = planted(1.0)
    _, x = made.columns.of(0, 0)
    x[:, 1] = np.sqrt(alike) * x[:, 0] + np.sqrt(1 - alike) * x[:, 2]
    labels = [SimpleNamespace(amplitudes=[0], count=1)] * 2
    items = [Item(i.index, i.spread, i.positive, False, y) for i, y in zip(made.items[:2], labels, strict=True)]
    made = Explained(made.pieces, made.columns, items, 0)
    several = [Hypothesis("curve", False, (items[0],), -1.0), Hypothesis("name", True, (items[1],), -12.0)]
    run = Search(ProjectedEvidence(made.evidence(), (0,)), several)
    slots = run.answer()
    assert [s.taken.hypothesis for s in slots] == [0]
    return names.as_names(run, slots)[0].taken.hypothesis == 1


def test_a_curve_becomes_the_name_that_it_nearly_is(monkeypatch):
    assert [becomes(x) for x in (0.5, 0.74, 0.76, 0.9)] == [False, False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "NEARLY", factor)
            assert becomes(0.5) is (factor < 1)
            assert becomes(0.9) is (factor < 1)
