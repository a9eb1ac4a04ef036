"""The evidence of hypotheses against the Gaussian density of all samples at once, by SciPy, in dense matrices."""

from dataclasses import replace

import numpy as np
import pytest
from explained import STEP, explained, hypotheses
from scipy.integrate import quad
from scipy.stats import norm

from snarelab.identification import deciding
from snarelab.identification.evidence import evidence as evidence_module
from snarelab.identification.evidence.members import SIZES, Members
from snarelab.identification.evidence.pool import CandidateColumns, Hypothesis
from snarelab.identification.evidence.projected import ProjectedEvidence
from snarelab.identification.nuisance.covariance import Covariance

FREE = (0, 1, 2, 5)
"""Items whose amplitudes may have either sign."""
POSITIVE, WHOLE = 3, 4
WEIGHT = np.array([1.0, 0.3, 1.0, 3.0, 0.1])


@pytest.fixture(params=range(3))
def case(request):
    made = explained(request.param)
    return made, made.evidence()


@pytest.mark.parametrize("weight", [None, WEIGHT])
@pytest.mark.parametrize("recordings", [(0,), (0, 1)])
def test_the_evidence_of_nothing_is_the_density_of_what_stands_beside(case, recordings, weight):
    made, evidence = case
    n = sum(len(own.residual) for i in recordings for own in made.pieces[i])
    found = ProjectedEvidence(evidence, recordings, weight).null - 0.5 * n * np.log(2 * np.pi)
    assert found == pytest.approx(made.log_density(recordings, (), weight), rel=1e-9)


@pytest.mark.parametrize("held", [(), (1,), (0, 1, 2)])
def test_what_other_recordings_say_stands_in_for_the_prior(case, held):
    """By Bayes' rule: the density of one recording given the other is that of both over that of the other. Parameters
    that are ``held`` do not vary in either."""
    _, evidence = case
    weight = WEIGHT.copy()
    weight[list(held)] = 0.0
    first, both = (ProjectedEvidence(evidence, numbers, weight) for numbers in ((0,), (0, 1)))
    known = first.posterior(len(weight))
    assert not np.any(known[1][list(held)])
    on = ProjectedEvidence(evidence, (1,), weight, known)
    assert on.null == pytest.approx(both.null - first.null, rel=1e-6)


@pytest.mark.parametrize("weight", [None, WEIGHT])
@pytest.mark.parametrize("recordings", [(0,), (0, 1)])
def test_a_log_bayes_factor_is_the_ratio_of_densities(case, recordings, weight):
    made, evidence = case
    on = ProjectedEvidence(evidence, recordings, weight)
    gains = Members(on).gains()
    nothing = made.log_density(recordings, (), weight)
    for number in FREE:
        for k, size in enumerate(SIZES):
            wanted = made.log_density(recordings, [(number, size)], weight) - nothing
            assert gains[number, k] == pytest.approx(wanted, rel=1e-7, abs=1e-8)
            assert Members(on, [(number, size)]).value == pytest.approx(wanted, rel=1e-7, abs=1e-8)
    wanted = made.log_density(recordings, [(WHOLE, deciding.WHOLE)], weight) - nothing
    assert gains[WHOLE, 0] == pytest.approx(wanted, rel=1e-7, abs=1e-8)
    assert np.all(np.isneginf(gains[WHOLE, 1:]))  # it has one size: what it does
    assert Members(on, [(WHOLE, 0.3)]).value == pytest.approx(wanted, rel=1e-7, abs=1e-8)


def test_an_amplitude_that_cannot_be_negative_has_twice_the_prior_where_it_may_be(case):
    """The Gaussian prior cut at zero, its density doubled, integrated by quadrature."""
    made, evidence = case
    gains = Members(ProjectedEvidence(evidence, (0, 1))).gains()
    r, k, a, pool = made.stacked((0, 1))
    solved = np.linalg.inv(k + a @ a.T)
    item = made.items[POSITIVE]
    c = pool[:, item.index[0]] * item.spread[0]
    score, curvature = c @ solved @ r, c @ solved @ c
    for k_, size in enumerate(SIZES):
        value, _ = quad(
            lambda t, size=size: 2 * norm.pdf(t, 0, size) * np.exp(t * score - 0.5 * curvature * t * t), 0, 12 * size,
            epsabs=0, epsrel=1e-10, limit=400, points=[max(score / (curvature + size**-2), 0.0)],
        )  # fmt: skip
        assert gains[POSITIVE, k_] == pytest.approx(np.log(value), rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("before", [((1, 0.3),), ((1, 0.1), (2, 0.3)), ((4, 0.3), (2, 0.03))])
def test_a_gain_on_top_of_others_is_the_difference_of_two_densities(case, before):
    made, evidence = case
    on, recordings = ProjectedEvidence(evidence, (0, 1), WEIGHT), (0, 1)
    members = Members(on, before)
    dense = [(number, deciding.WHOLE if made.items[number].whole else size) for number, size in before]
    nothing, own = made.log_density(recordings, (), WEIGHT), made.log_density(recordings, dense, WEIGHT)
    assert members.value == pytest.approx(own - nothing, rel=1e-8)
    gains = members.gains()
    for number in FREE:
        for k, size in enumerate(SIZES):
            wanted = made.log_density(recordings, [*dense, (number, size)], WEIGHT) - own
            assert gains[number, k] == pytest.approx(wanted, rel=1e-6, abs=1e-7)
    wanted = made.log_density(recordings, [*dense, (WHOLE, deciding.WHOLE)], WEIGHT) - own
    if WHOLE not in dict(before):
        assert gains[WHOLE, 0] == pytest.approx(wanted, rel=1e-6, abs=1e-7)


def test_amplitudes_and_what_stands_beside_are_the_posterior_mean(case):
    """All unknowns in one Gaussian regression, with the prior's precision."""
    made, evidence = case
    on, taken = ProjectedEvidence(evidence, (0, 1), WEIGHT), [(1, 0.3), (WHOLE, 1.0)]
    members = Members(on, taken)
    r, k, a, pool = made.stacked((0, 1))
    c = np.concatenate([pool[:, made.items[n].index] * made.items[n].spread for n, _ in taken], axis=1)
    x = np.concatenate([a, c], axis=1)
    precision = np.concatenate([WEIGHT**-2.0, np.full(2, 0.3**-2), np.full(1, deciding.WHOLE**-2)])
    mean = np.array([*np.zeros(7), 1.0])
    solved = np.linalg.solve(k, x)
    wanted = np.linalg.solve(x.T @ solved + np.diag(precision), solved.T @ r + precision * mean)
    np.testing.assert_allclose(members.amplitudes, wanted[5:], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(members.of(WHOLE), wanted[7:], rtol=1e-7)
    mean_of = [(number, members.of(number)) for number, _ in taken]
    np.testing.assert_allclose(on.beside(mean_of), wanted[:5], rtol=1e-6, atol=1e-8)


def test_what_is_left_of_each_sample_adds_up_to_the_whitened_energy(case):
    made, evidence = case
    always, amplitudes = np.linspace(-1, 1, 5), np.array([0.3, -0.2])
    left = evidence.left(1, always, [(made.items[1], amplitudes)])
    r, k, a, pool = made.stacked((1,))
    e = r - a @ always - pool[:, made.items[1].index] @ (made.items[1].spread * amplitudes)
    assert left.energy.sum() == pytest.approx(e @ np.linalg.solve(k, e), rel=1e-9)
    n = len(made.pieces[1][0].residual)
    by_sample = (e * np.linalg.solve(k, e)).reshape(2, n).sum(axis=0)
    np.testing.assert_allclose(left.energy, by_sample, rtol=1e-7, atol=1e-9)
    for c in range(2):
        own = made.pieces[1][c]
        energy = own.residual @ np.linalg.solve(own.covariance.dense(), own.residual)
        assert evidence.energy(1, c) == pytest.approx(energy, rel=1e-9)


def test_curvature_and_score_are_those_of_the_dense_matrices(case):
    made, evidence = case
    on = ProjectedEvidence(evidence, (0, 1), WEIGHT)
    r, k, a, pool = made.stacked((0, 1))
    solved = np.linalg.inv(k + (a * WEIGHT**2) @ a.T)
    for one in FREE:
        x = pool[:, made.items[one].index] * made.items[one].spread
        np.testing.assert_allclose(on.score(one), x.T @ solved @ r, rtol=1e-7, atol=1e-9)
        for other in FREE:
            y = pool[:, made.items[other].index] * made.items[other].spread
            np.testing.assert_allclose(on.curvature(one, other), x.T @ solved @ y, rtol=1e-6, atol=1e-8)


def test_channels_that_an_item_reaches(case):
    made, evidence = case
    assert [evidence.reached(x) for x in made.items[:3]] == [[0], [0, 1], [1]]
    assert not evidence.contribution(0, 0, made.items[2], np.ones(3)).any()


@pytest.mark.parametrize("c", [0, 1])
def test_a_channel_by_itself_keeps_each_shape_that_reaches_it(case, c):
    """A hypothesis reaches either channel at one of its two shapes only; the channel goes back with other noise."""
    made, _ = case
    pool = [Hypothesis("some", True, (made.items[0], made.items[2]), 0.0), *hypotheses([made.items[1]], 1.0)]
    made.items = [x for h in pool for x in h.items]
    alone, own, _ = made.evidence().alone(c, pool)
    assert [len(h.items) for h in own] == [1, 1]
    others = [Covariance(np.full(len(row[c].residual), 2.0), [], None, STEP, (slice(0, None),)) for row in made.pieces]
    alone = alone.with_covariances(0, others)
    ProjectedEvidence(alone, (0, 1))
    found = ProjectedEvidence(made.evidence().with_channel(c, alone), (0, 1))
    for row, other in zip(made.pieces, others, strict=True):
        row[c] = replace(row[c], covariance=other)
    fresh = ProjectedEvidence(made.evidence(), (0, 1))
    for one in range(3):
        np.testing.assert_allclose(found.score(one), fresh.score(one), rtol=1e-9)
        np.testing.assert_allclose(found.curvature(one, one), fresh.curvature(one, one), rtol=1e-9)


def test_columns_are_given_back_in_the_order_that_was_asked_for():
    rng = np.random.default_rng(0)
    columns = CandidateColumns([7, 5])
    one, two = ([rng.normal(size=(n, k)) for n in (7, 5)] for k in (2, 3))
    a, b = columns.add({1: one}), columns.add({0: two, 1: two})
    assert (a.tolist(), b.tolist(), columns.count) == ([0, 1], [2, 3, 4], 5)
    wanted = np.array([4, 0, 2])
    asked = np.stack([two[1][:, 2], one[1][:, 0], two[1][:, 0]], 1)
    np.testing.assert_array_equal(columns.some(1, 1, wanted), asked.astype(np.float32))
    assert columns.some(0, 2, np.zeros(0, int)).shape == (7, 0)
    assert [columns.has(c, 1) for c in (0, 1, 2)] == [False, True, False]
    numbers, x = columns.of(0, 0)
    assert numbers.tolist() == [2, 3, 4]
    np.testing.assert_array_equal(x, two[0].astype(np.float32))


@pytest.mark.parametrize("recording", [0, 1])
def test_products_do_not_depend_on_how_many_rows_are_worked_on_together(case, recording, monkeypatch):
    """The last run of rows is shorter than the others, and noise is remembered from one to the next."""
    made, evidence = case
    for c in range(2):
        whole, row = evidence.products(recording, c), evidence.row(recording, c, 1)
        assert len(made.pieces[recording][c].residual) % 7
        with monkeypatch.context() as patch:
            patch.setattr(evidence_module, "ROWS", 7)
            other = made.evidence()
            parts = other.products(recording, c)
            np.testing.assert_allclose(other.row(recording, c, 1), row, rtol=1e-9, atol=1e-9)
        for name in ("always", "seen", "beside", "score"):
            np.testing.assert_allclose(getattr(parts, name), getattr(whole, name), rtol=1e-9, atol=1e-9)
        assert parts.each.keys() == whole.each.keys()
        for key, own in whole.each.items():
            np.testing.assert_allclose(parts.each[key], own, rtol=1e-9, atol=1e-9)


def test_a_set_is_worth_the_same_whichever_of_its_members_comes_last(case, monkeypatch):
    _, evidence = case
    on = ProjectedEvidence(evidence, (0, 1), WEIGHT)
    one, other = ((0, 0.3), (1, 0.1), (2, 0.3)), ((2, 0.3), (0, 0.3), (1, 0.1))
    assert Members(on, one).value == pytest.approx(Members(on, other).value, rel=1e-9)
    alone = ProjectedEvidence(evidence, (0, 1), WEIGHT)
    with monkeypatch.context() as patch:
        patch.setattr(alone, "cross", lambda number: pytest.fail("the value of one member needs no other column"))
        assert Members(alone, [(1, 0.3)]).value == pytest.approx(Members(on, [(1, 0.3)]).value, rel=1e-12)


def test_items_by_themselves_keep_their_evidence(case):
    """The second reaches both channels, the third the last alone."""
    _, evidence = case
    chosen = [2, 1]
    on = ProjectedEvidence(evidence, (0, 1), WEIGHT)
    alone = ProjectedEvidence(evidence.of_items(chosen), (0, 1), WEIGHT)
    assert alone.null == pytest.approx(on.null, rel=1e-12)
    assert len(alone.score_all) == len({int(k) for x in chosen for k in evidence.items[x].index})
    wanted, found = Members(on, [(2, 0.3), (1, 0.1)]), Members(alone, [(0, 0.3), (1, 0.1)])
    assert found.value == pytest.approx(wanted.value, rel=1e-9)
    np.testing.assert_allclose(found.amplitudes, wanted.amplitudes, rtol=1e-9)


def test_what_an_item_adds_is_less_what_it_takes_over(case):
    """The residual changed by the item's column: what stands beside follows by generalised least squares."""
    made, evidence = case
    on = ProjectedEvidence(evidence, (0, 1), WEIGHT)
    item, amplitude = evidence.items[0], np.array([0.7])
    (c,) = evidence.reached(item)
    _, k, always, pool = made.stacked((0, 1))
    column = pool[:, item.index] @ (item.spread * amplitude)
    always = always * WEIGHT
    solved = np.linalg.solve(k, np.column_stack([always, column]))
    normal = always.T @ solved[:, :-1] + np.eye(len(WEIGHT))
    wanted = column - always @ np.linalg.solve(normal, always.T @ solved[:, -1])
    lengths = [len(own.residual) for i in (0, 1) for own in made.pieces[i]]
    parts = np.split(wanted, np.cumsum(lengths)[:-1])
    for i in (0, 1):
        np.testing.assert_allclose(on.added(i, c, 0, amplitude), parts[2 * i + c], atol=1e-9)
