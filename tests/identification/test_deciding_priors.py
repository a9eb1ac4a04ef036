"""Prior odds and sizes, halved and doubled: an answer that stands at them must change."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from explained import Explained, hypotheses, white
from moved_numbers import FACTORS, about, move, odds_of, planted, searched, smallest

from snarelab.identification.arms import hypotheses as hypothesising
from snarelab.identification.arms.laws import coordinate
from snarelab.identification.evidence.evidence import Evidence, ResidualChannel
from snarelab.identification.evidence.members import Members
from snarelab.identification.evidence.pool import CandidateColumns, Item
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.evidence.search import Search
from snarelab.identification.search.candidates import EffectVariant
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def test_priors_are_shared_by_effects_and_by_places():
    several = odds_of(white(np.random.default_rng(0), 10, {}))
    one_of_five = 0.5 / 5 + 0.5 / 25
    assert [np.exp(h.prior) for h in several] == pytest.approx([0.5 / 2 * one_of_five] * 5 + [0.5 / 2] + [0.2 / 4] * 4)
    assert [h.named for h in several] == [True] * 6 + [False] * 4


@pytest.mark.parametrize(("constant", "first"), [("ODDS_OF_NAMES", 0), ("ODDS_OF_CURVES", 6)])
def test_the_smallest_that_is_told_hangs_on_the_prior_odds(monkeypatch, constant, first):
    """ln 2 more or less of log Bayes factor; a size that is told with double the odds is not told with half of them."""

    def told(size):
        made = planted(size)
        order = [first, *(k for k in range(10) if k != first)]
        items = [made.items[order.index(k)] for k in range(10)]
        made = Explained(made.pieces, made.columns, items, 0)
        several = odds_of(made)
        return searched(Explained(made.pieces, made.columns, [x for h in several for x in h.items], 0), several)

    before = smallest(told)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert bool(smallest(told) < 0.99 * before) is (factor > 1)
            assert told(before / 1.005) is (factor > 1)
            assert told(1.005 * before) is (factor > 1)


@pytest.mark.parametrize("spread", [0.08, 300.0])
def test_the_smallest_that_is_named_hangs_on_the_sizes(monkeypatch, spread):
    """A small effect needs sizes as small, a large one pays for those beyond it."""

    def named(size):
        made = planted(size)
        items = [Item(x.index, np.array([spread]), x.positive) for x in made.items]
        made = Explained(made.pieces, made.columns, items, 0)
        return searched(made, hypotheses(items, 0.05))

    before = smallest(named)
    found = []
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "SIZES", factor)
            found.append(smallest(named))
    assert not np.isclose(found[0], before, rtol=2e-3)
    assert not np.isclose(found[1], before, rtol=2e-3)


def test_sizes_that_are_averaged_over():
    """Log Bayes factor of each, against dense matrices, of an effect of 0.1 in noise of one."""
    made = planted(0.1)
    gains = Members(ProjectedEvidence(made.evidence(), (0,))).gains()
    nothing = made.log_density([0])
    wanted = [made.log_density([0], [(0, size)]) - nothing for size in (0.003, 0.01, 0.03, 0.1, 0.3)]
    assert gains[0] == pytest.approx(wanted, abs=1e-4)


def test_how_far_a_whole_law_may_be_from_its_own_size(monkeypatch):
    """Of one that does 0.8 of what it should, in noise that tells: named, and with half the deviation not."""
    made = planted(1.0)
    own = made.pieces[0][0]

    def gain(size):
        made.pieces[0][0] = ResidualChannel(size * own.residual * 2, own.covariance, own.index, own.columns)
        x = Item(made.items[0].index, 2 * np.ones(1), np.ones(1, bool), True)
        on = ProjectedEvidence(Evidence(made.pieces, made.columns, [x], 0), (0,))
        return Members(on).gains()[0, 0]

    def farthest():
        """The largest amplitude beyond one at which a law is likelier than nothing by e⁴⁰."""
        return max(s for s in np.linspace(1.0, 3.0, 401) if gain(s) - 0.5 * 200 * (2 * s) ** 2 > -15)

    before = farthest()
    found = []
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "WHOLE", factor)
            found.append(farthest())
    assert found[0] < before - 0.05
    assert found[1] > before + 0.05
    less, own_size, more = about(monkeypatch, "WHOLE", 0.12, farthest)
    assert less < own_size < more


def test_an_effect_that_is_at_one_joint_is_likelier_at_another(monkeypatch):
    """The smallest viscous friction that is told at a second of five joints, beside one that is plain."""

    def told(size):
        made = planted(1.0)
        _, x = made.columns.of(0, 0)
        own = made.pieces[0][0]
        made.pieces[0][0] = ResidualChannel(x[:, 0] + size * x[:, 1], own.covariance, own.index, own.columns)
        several = odds_of(made)
        slots = Search(ProjectedEvidence(made.evidence(), (0,)), several).answer()
        return 1 in {s.taken.hypothesis for s in slots}

    before = smallest(told)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "ELSEWHERE", factor)
            assert bool(smallest(told) < 0.97 * before) is (factor > 1)
            assert bool(smallest(told) > 1.03 * before) is (factor < 1)


def shaped(monkeypatch, off: float, bent: float, curve: bool) -> float:
    """Log Bayes factor of a law at the middle one of three shapes, which is off by so many steps, and bent by so much.

    Between shapes the law changes by one of ten columns, and it is bent by another, over which there may be a curve.
    """
    made = planted(1.0)
    x = made.columns.of(0, 0)[1].astype(float)
    placed = PlacedEffect(get_effect("stribeck_friction"), "joint1")
    grid = [
        EffectVariant(placed, np.array([1.0, s]), np.zeros(1, int), np.zeros(1), np.ones(1)) for s in (1.0, 2.0, 3.0)
    ]
    laws = {v.parameters[1]: x[:, [0]] + (v.parameters[1] - 2) * x[:, [1]] for v in grid}
    monkeypatch.setattr(hypothesising, "_grid", lambda *_: (grid, not curve))
    monkeypatch.setattr(hypothesising, "_made", lambda _, v: {0: [laws[v.parameters[1]]]})
    columns = CandidateColumns([len(x)])
    over = Item(columns.add({0: [x[:, [2]]]}), np.ones(1), np.zeros(1, bool))
    words = coordinate(placed.effect) or ""
    assembly = SimpleNamespace(joint_of=lambda _: 0, at=lambda _: SimpleNamespace(once_more=lambda _: None))
    along: Any = SimpleNamespace(n_train=1, scale=np.ones(1), assembly=assembly, tuned={}, peaks={})
    items = hypothesising._items(along, placed, {(0, words): over} if curve else {}, columns)
    own = made.pieces[0][0]
    residual = 0.3 * 10 * (x[:, 0] + off * x[:, 1] + bent * x[:, 2])
    channel = ResidualChannel(residual, own.covariance, own.index, own.columns)
    gains = Members(ProjectedEvidence(Evidence([[channel]], columns, items, 0), (0,))).gains()
    middle = [k for k, item in enumerate(items) if item.label.parameters[1] == 2.0]
    return float(gains[middle].max())


@pytest.mark.parametrize(
    ("constant", "value", "off", "bent"), [("SLOPE", 0.3, 0.6, 0.0), ("BENDS", (0.15, 0.4), 0.0, 1.2)]
)
def test_how_far_a_law_may_be_from_a_shape_that_is_tried(monkeypatch, constant, value, off, bent):
    """One that is far from it is believed more with more freedom, one that is just that shape with less."""
    curve = constant == "BENDS"

    def believed():
        return shaped(monkeypatch, off, bent, curve), shaped(monkeypatch, 0.0, 0.0, curve)

    far, near = believed()
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            other = believed()
        assert (other[0] > far + 0.3) if factor > 1 else (other[0] < far - 0.3), f"{constant} times {factor}"
        assert (other[1] < near - 0.1) if factor > 1 else (other[1] > near + 0.1), f"{constant} times {factor}"
    less, as_it_is, more = about(monkeypatch, constant, value, lambda: believed()[0])
    assert less < as_it_is < more
    less, as_it_is, more = about(monkeypatch, constant, value, lambda: believed()[1])
    assert less > as_it_is > more
