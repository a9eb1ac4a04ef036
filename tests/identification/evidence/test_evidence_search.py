"""The search over sets: a planted pair among decoys, false alarms counted in noise, twins, and who is barred."""

from dataclasses import replace

import numpy as np
import pytest
from explained import Explained, explained, hypotheses, white

from snarelab.identification.decision.names import likeness, share_of_residual
from snarelab.identification.evidence.members import Members
from snarelab.identification.evidence.pool import Hypothesis, Item
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.evidence.search import Search

DECOYS = 30


def search(made: Explained, odds=0.5 / DECOYS, barred=(), named=None) -> Search:
    return Search(ProjectedEvidence(made.evidence(), (0,)), hypotheses(made.items, odds, named), barred)


def found(made: Explained, **given) -> list[int]:
    return sorted(s.taken.hypothesis for s in search(made, **given).answer())


@pytest.mark.parametrize("seed", range(10))
def test_a_pair_is_found_among_decoys_and_nothing_else(seed):
    """0.5 times the noise on each of 200 samples: seven standard errors."""
    made = white(np.random.default_rng(seed), DECOYS, {4: 0.5, 17: -0.5})
    slots = search(made).answer()
    assert {4, 17} <= {s.taken.hypothesis for s in slots}
    assert len(slots) <= 3
    for s in slots:
        if s.taken.hypothesis in (4, 17):
            assert s.shares[s.taken.hypothesis] > 0.99
            assert s.shares.sum() == pytest.approx(1.0)


def test_in_noise_a_name_is_rarer_than_its_prior_odds_allow():
    """A Bayes factor exceeds x with a probability of at most 1/x where there is nothing (Markov): at all places
    together no more often than the prior odds, 0.5. Averaged over sizes it is far rarer: counted on 200 draws."""
    alarms = sum(bool(found(white(np.random.default_rng(1000 + s), DECOYS, {}))) for s in range(200))
    assert alarms <= 10


def test_more_places_to_look_at_need_more_evidence():
    """The same residual: what is named as one of thirty is not named as one of thirty thousand."""
    for seed in range(20):
        made = white(np.random.default_rng(seed), DECOYS, {4: 0.31})
        if found(made) == [4]:
            break
    else:
        raise AssertionError("never named")
    gain = Members(ProjectedEvidence(made.evidence(), (0,))).gains()[4].max()
    assert found(made, odds=0.5 * np.exp(-gain)) == []


def test_of_two_effects_whose_sum_a_third_imitates_the_two_are_found():
    """A forward search takes the third, which explains most alone; exchanges and steps back mend it."""
    rng = np.random.default_rng(3)
    made = white(rng, 6, {})
    _, x = made.columns.of(0, 0)
    x[:, 2] = (x[:, 0] + x[:, 1]) / np.sqrt(2) + 0.2 * rng.normal(size=len(x))
    own = made.pieces[0][0]
    residual = own.residual + 1.4 * x[:, 0] + 0.7 * x[:, 1]
    made.pieces[0][0] = type(own)(residual, own.covariance, own.index, own.columns)
    run = search(made)
    first = int(np.argmax(run.scan([]).odds))
    assert first == 2
    assert sorted(s.taken.hypothesis for s in run.answer()) == [0, 1]


def test_amplitudes_are_those_of_the_member_asked_for():
    """A set is worked out once, whatever the order it is asked for in."""
    made = white(np.random.default_rng(4), 3, {0: 2.0, 1: -1.0})
    run = search(made)
    taken = [s.taken for s in run.answer()]
    for some in (taken, taken[::-1]):
        members = run.members(some)
        amplitudes = [float(members.of(t.item)[0]) for t in some]
        assert amplitudes == pytest.approx([{0: 2.0, 1: -1.0}[t.hypothesis] for t in some], abs=0.3)


def test_what_is_barred_is_not_taken_and_no_rival():
    made = white(np.random.default_rng(5), DECOYS, {4: 0.6, 17: 0.6})
    slots = search(made, barred=(4,)).answer()
    assert 4 not in {s.taken.hypothesis for s in slots}
    assert all(np.isneginf(s.odds[4]) for s in slots)
    assert all(s.shares[4] == 0 for s in slots)


def test_a_whole_law_does_not_stand_beside_its_parts():
    """Two parts and a law that can write their sum and more: all three are there, and no set has it beside a part."""
    made = white(np.random.default_rng(12), 3, {0: 0.8, 1: 0.8, 2: 0.8})
    assert found(made, odds=0.1) == [0, 1, 2]
    pool = hypotheses(made.items, 0.1)
    parts, whole = frozenset(h.key for h in pool[:2]), frozenset({pool[2].key})
    pool = [replace(h, apart=parts if k == 2 else whole) for k, h in enumerate(pool)]
    slots = Search(ProjectedEvidence(made.evidence(), (0,)), pool).answer()
    assert sorted(s.taken.hypothesis for s in slots) in ([0, 1], [2])
    assert all(np.isneginf(s.odds[2]) == (len(slots) > 1) for s in slots)


def test_twins_share_their_slot():
    """The same column twice, of another spread: one is taken, and the two share it by their prior odds."""
    made = white(np.random.default_rng(6), 3, {0: 0.8})
    twin = made.items[0]
    made.items.append(Item(twin.index, twin.spread, twin.positive))
    pool = hypotheses(made.items, 0.1)
    pool[3] = Hypothesis("twin", True, pool[3].items, float(np.log(0.3)))
    run = Search(ProjectedEvidence(made.evidence(), (0,)), pool)
    (slot,) = run.answer()
    assert slot.taken.hypothesis == 3
    assert slot.shares[3] == pytest.approx(0.75, abs=1e-3)
    assert slot.shares[0] == pytest.approx(0.25, abs=1e-3)


def test_a_hypothesis_is_the_average_of_its_shapes():
    """A grid of five shapes of which one is right pays for the other four: its log odds fall by log 5 at most."""
    made = white(np.random.default_rng(7), 5, {2: 0.6})
    on = ProjectedEvidence(made.evidence(), (0,))
    alone = Search(on, hypotheses(made.items, 0.1)).scan([])
    grid = Search(on, [Hypothesis("grid", True, tuple(made.items), float(np.log(0.1)))]).scan([])
    gains = Members(on).gains()
    wanted = np.log(np.mean(np.exp(gains))) + np.log(0.1)
    assert grid.odds[0] == pytest.approx(wanted, rel=1e-12)
    assert grid.item[0] == 2
    assert alone.odds[2] - np.log(5) <= grid.odds[0] < alone.odds[2]


def test_an_item_that_stands_for_more_of_a_grid_pays_for_it():
    """Of twenty shapes two are kept, the right one and another: the odds are those of the whole grid, the rest of which
    explains nothing; and the choice between a set's items is by their prior too."""
    made = white(np.random.default_rng(7), 20, {2: 0.6})
    on = ProjectedEvidence(made.evidence(), (0,))
    whole = Search(on, [Hypothesis("grid", True, tuple(made.items), float(np.log(0.1)))]).scan([])
    few = white(np.random.default_rng(7), 20, {2: 0.6})
    few.items[:] = [replace(few.items[k], prior=float(np.log(2 / 20))) for k in (2, 7)]
    on = ProjectedEvidence(few.evidence(), (0,))
    kept = Search(on, [Hypothesis("grid", True, tuple(few.items), float(np.log(0.1)))])
    assert kept.scan([]).odds[0] == pytest.approx(whole.odds[0], abs=0.01)
    taken = kept.take([], 0)
    assert kept.total([taken]) == pytest.approx(kept.scan([]).odds[0], rel=1e-9)
    few.items[0] = replace(few.items[0], prior=-1e3)
    assert Search(on, [Hypothesis("grid", True, tuple(few.items), 0.0)]).scan([]).item[0] == 1


def test_without_a_hypothesis_nothing_is_found():
    made = white(np.random.default_rng(8), 1, {})
    assert Search(ProjectedEvidence(made.evidence(), (0,)), []).answer() == []


def test_a_curve_wins_over_a_name_that_only_looks_like_it():
    """Column 1 is a name at 0.8 of the curve's column 0."""
    rng = np.random.default_rng(9)
    made = white(rng, 2, {})
    _, x = made.columns.of(0, 0)
    x[:, 1] = 0.8 * x[:, 0] + 0.6 * x[:, 1]
    own = made.pieces[0][0]
    made.pieces[0][0] = type(own)(own.residual + 1.5 * x[:, 0], own.covariance, own.index, own.columns)
    pool = hypotheses(made.items, 0.1, named=[False, True])
    (slot,) = Search(ProjectedEvidence(made.evidence(), (0,)), pool).answer()
    assert not pool[slot.taken.hypothesis].named


@pytest.mark.parametrize("cosine", [1.0, 0.9, 0.5, 0.0])
def test_likeness_is_the_share_of_what_one_adds_that_another_can_add(cosine):
    """Of single columns the squared cosine; in white noise with nothing beside."""
    rng, n = np.random.default_rng(10), 200
    made = white(rng, 2, {})
    _, x = made.columns.of(0, 0)
    q = np.linalg.qr(rng.normal(size=(n, 2)))[0] * np.sqrt(n)
    x[:, 0], x[:, 1] = q[:, 0], -3 * (cosine * q[:, 0] + np.sqrt(1 - cosine**2) * q[:, 1])
    for item in made.items:
        object.__setattr__(item, "label", type("Label", (), {"amplitudes": [0], "count": 1})())
    run = search(made)
    amplitudes = np.array([0.7])
    energy = float(amplitudes @ run.on.curvature(0, 0) @ amplitudes)
    assert likeness(run, 0, amplitudes, energy, 1) == pytest.approx(cosine**2, abs=1e-6)


def test_the_share_of_the_residual_is_of_what_stands_beside_everything_leaves():
    made = explained(4)
    run = Search(ProjectedEvidence(made.evidence(), (0, 1)), hypotheses(made.items, 0.1))
    amplitudes = np.array([0.3, 0.4])
    r, k, a, pool = made.stacked((0, 1))
    solved = np.linalg.inv(k + a @ a.T)
    c = pool[:, made.items[1].index] @ (made.items[1].spread * amplitudes)
    gained = r @ solved @ r - (r - c) @ solved @ (r - c)
    left = r - a @ a.T @ solved @ r
    wanted = gained / (left @ np.linalg.solve(k, left))
    assert 0 < wanted < 1
    assert share_of_residual(run, 1, amplitudes) == pytest.approx(wanted, rel=1e-7)
