"""Gains, shares and nulls of a candidate, against regressions done the slow way on stacked matrices."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.optimize
import scipy.stats

from snarelab.identification.search.evidence import KNOWN, Channel, Evidence
from snarelab.identification.search.judged import Samples

N_PARAMETERS, N_BLOCKS = 5, 6
FREE = (np.full(2, -np.inf), np.full(2, np.inf))


class Problem:
    """Two channels of different length that share two of five parameters, and a candidate of two columns on both."""

    def __init__(self, seed, sizes=(210, 130), k=2):
        rng = np.random.default_rng(seed)
        self.index = [np.array([0, 1, 4]), np.array([2, 4, 3, 1])]
        self.columns = [rng.normal(size=(n, len(i))) for n, i in zip(sizes, self.index, strict=True)]
        self.candidate = [rng.normal(size=(n, k)) + 0.3 * x[:, :1] for n, x in zip(sizes, self.columns, strict=True)]
        self.residual = [rng.normal(size=n) + 0.4 * c.sum(1) for n, c in zip(sizes, self.candidate, strict=True)]
        self.noise = [rng.normal(size=n) for n in sizes]
        self.block = [np.sort(rng.integers(0, N_BLOCKS, n)) for n in sizes]

    def evidence(self, n_nulls=20):
        parts = zip(self.index, self.columns, self.residual, self.noise, self.block, strict=True)
        return Evidence([Channel(*part) for part in parts], N_PARAMETERS, N_BLOCKS, n_nulls, seed=3)

    def products(self, evidence):
        return evidence.products(list(enumerate(self.candidate)))

    @property
    def x(self):
        stacked = []
        for i, columns in zip(self.index, self.columns, strict=True):
            full = np.zeros((len(columns), N_PARAMETERS))
            full[:, i] = columns
            stacked.append(full)
        return np.concatenate(stacked)

    @property
    def c(self):
        return np.concatenate(self.candidate)

    @property
    def y(self):
        return np.concatenate(self.residual)

    @property
    def blocks(self):
        return np.concatenate(self.block)


def left(a, y):
    """Half the squared residual of a regression."""
    return 0.5 * np.sum((y - a @ np.linalg.lstsq(a, y, rcond=None)[0]) ** 2)


def bounded(x, c, y, low, high):
    """Baseline free and amplitudes between bounds, by scipy: (all coefficients, half the squared residual)."""
    limits = np.full(x.shape[1], np.inf)
    a = np.hstack([x, c])
    if np.isinf(low).all() and np.isinf(high).all():  # SciPy's bounded solver is loose where columns depend
        free = np.linalg.lstsq(a, y, rcond=1e-10)[0]
        return free, 0.5 * np.sum((y - a @ free) ** 2)
    found = scipy.optimize.lsq_linear(a, y, (np.r_[-limits, low], np.r_[limits, high]), method="bvls", tol=1e-14)
    return found.x, 0.5 * np.sum((y - a @ found.x) ** 2)


@pytest.fixture(params=range(4))
def problem(request):
    return Problem(request.param)


def test_gain_is_what_the_regression_gains(problem):
    evidence = problem.evidence()
    gain = evidence.gain(problem.products(evidence), *FREE)
    both = np.hstack([problem.x, problem.c])
    assert gain.total == pytest.approx(left(problem.x, problem.y) - left(both, problem.y), rel=1e-9)
    np.testing.assert_allclose(gain.amplitudes, np.linalg.lstsq(both, problem.y, rcond=None)[0][-2:], rtol=1e-8)
    parts = [2 * left(problem.x, c) / (c @ c) for c in problem.c.T]
    assert gain.unabsorbed == pytest.approx(min(parts), rel=1e-9)


def test_a_channel_without_a_sample_says_nothing(problem):
    """A joint that never moves has none in motion."""
    none = Problem(9, sizes=(0, 0))
    channels = [*problem.evidence().channels, none.evidence().channels[0]]
    evidence = Evidence(channels, N_PARAMETERS, N_BLOCKS, 20, seed=3)
    gain = evidence.gain(evidence.products([*enumerate(problem.candidate), (2, none.candidate[0])]), *FREE)
    wanted = problem.evidence().gain(problem.products(problem.evidence()), *FREE)
    assert gain.total == pytest.approx(wanted.total, rel=1e-12)
    np.testing.assert_allclose(gain.amplitudes, wanted.amplitudes, rtol=1e-12)


def test_a_candidate_on_one_channel_only():
    problem = Problem(7)
    evidence = problem.evidence()
    gain = evidence.gain(evidence.products([(1, problem.candidate[1])]), *FREE)
    c = np.concatenate([0 * problem.candidate[0], problem.candidate[1]])
    wanted = left(problem.x, problem.y) - left(np.hstack([problem.x, c]), problem.y)
    assert gain.total == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("low", [(-np.inf, 0.0), (0.0, 0.5), (0.45, -0.1)])
def test_bounded_amplitudes_are_scipys(problem, low):
    evidence = problem.evidence()
    bounds = np.array(low), np.array([0.6, 0.2]) + np.maximum(np.array(low), 0.0)
    bounds[1][0] = max(bounds[1][0], 0.01)
    gain = evidence.gain(problem.products(evidence), *bounds)
    found, cost = bounded(problem.x, problem.c, problem.y, *bounds)
    np.testing.assert_allclose(gain.amplitudes, found[-2:], atol=1e-8)
    assert gain.total == pytest.approx(left(problem.x, problem.y) - cost, rel=1e-8, abs=1e-8)


def test_an_amplitude_of_the_wrong_sign_gains_nothing():
    problem = Problem(1, k=1)
    evidence = problem.evidence()
    gain = evidence.gain(problem.products(evidence), np.array([-np.inf]), np.array([0.0]))
    assert gain.amplitudes[0] == pytest.approx(0.0, abs=1e-12)
    assert gain.total == pytest.approx(0.0, abs=1e-9)


def check_fresh(problem, bounds):
    evidence = problem.evidence()
    fresh = evidence.fresh_gains(problem.products(evidence), *bounds)
    x, c, y, blocks = problem.x, problem.c, problem.y, problem.blocks
    for b in range(N_BLOCKS):
        own = blocks == b
        # The block's own rows stay with a small weight and ask for no step; what they measured does not.
        weight, target = np.where(own, np.sqrt(KNOWN), 1.0)[:, None], np.where(own, 0.0, y)
        without = np.linalg.lstsq(weight * x, target, rcond=None)[0]
        beside, _ = bounded(weight * x, weight * c, target, *bounds)
        before = 0.5 * np.sum((y[own] - x[own] @ without) ** 2)
        after = 0.5 * np.sum((y[own] - np.hstack([x, c])[own] @ beside) ** 2)
        assert fresh[b] == pytest.approx(before - after, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("bounds", [FREE, (np.array([0.0, -1.0]), np.array([0.3, 0.3]))])
def test_fresh_gains_are_a_refit_without_the_block(problem, bounds):
    check_fresh(problem, bounds)


def test_fresh_gains_of_chance_are_below_nothing_on_average():
    """A column of chance fitted elsewhere costs about half a unit in all; fitted to everything it gains about half."""
    totals = []
    for seed in range(60):
        problem = Problem(seed, k=1)
        problem.residual = problem.noise
        evidence = problem.evidence()
        bounds = np.full(1, -np.inf), np.full(1, np.inf)
        products = problem.products(evidence)
        totals.append((evidence.fresh_gains(products, *bounds).sum(), evidence.gain(products, *bounds).total))
    fresh, fitted = np.mean(totals, axis=0)
    assert fresh < 0
    assert fitted == pytest.approx(0.5, abs=0.25)


@pytest.mark.parametrize("bounds", [FREE, (np.array([0.0, -1.0]), np.array([0.3, 0.3]))])
def test_shares_are_the_gain_block_by_block(problem, bounds):
    evidence = problem.evidence()
    products = problem.products(evidence)
    gain = evidence.gain(products, *bounds)
    shares = evidence.shares(products, gain.amplitudes)
    x, c, y = problem.x, problem.c, problem.y
    before = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    after = y - np.hstack([x, c]) @ bounded(x, c, y, *bounds)[0]
    for b in range(N_BLOCKS):
        own = problem.blocks == b
        assert shares[b] == pytest.approx(0.5 * np.sum(before[own] ** 2 - after[own] ** 2), rel=1e-7, abs=1e-7)
    assert shares.sum() == pytest.approx(gain.total, rel=1e-8)


def test_null_gains_are_regressions_of_sign_flipped_noise(problem):
    evidence = problem.evidence(n_nulls=12)
    found = evidence.null_gains(problem.products(evidence))
    flipped = np.concatenate([c.noise[:, None] * evidence.signs[c.block] for c in evidence.channels])
    ratio = flipped / np.concatenate(problem.noise)[:, None]
    for b in range(N_BLOCKS):
        np.testing.assert_allclose(np.ptp(ratio[problem.blocks == b], axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.unique(np.round(ratio, 9)), [-1.0, 1.0])
    both = np.hstack([problem.x, problem.c])
    wanted = [left(problem.x, e) - left(both, e) for e in flipped.T]
    np.testing.assert_allclose(found, wanted, rtol=1e-8)


@pytest.mark.parametrize("k", [1, 3])
def test_quantiles_of_the_null_are_chi_squared(k):
    """Twice the gain on white noise of unit variance is chi squared with k degrees of freedom (Wilks 1938)."""
    rng, n, blocks = np.random.default_rng(4), 3000, 300
    x, c = rng.normal(size=(n, 2)), rng.normal(size=(n, k))
    channel = Channel(np.arange(2), x, rng.normal(size=n), rng.normal(size=n), np.arange(n) * blocks // n)
    evidence = Evidence([channel], 2, blocks, 5000)
    nulls = 2 * evidence.null_gains(evidence.products([(0, c)]))
    for level in (0.5, 0.9, 0.99):
        assert np.quantile(nulls, level) == pytest.approx(scipy.stats.chi2.ppf(level, k), rel=0.2)


def test_likeness_is_the_cosine_after_the_baseline():
    problem, rng = Problem(5), np.random.default_rng(8)
    evidence = problem.evidence()
    a = {0: rng.normal(size=210), 1: rng.normal(size=130)}
    b = {1: a[1] + 0.5 * rng.normal(size=130) + 3.0 * problem.columns[1][:, 0]}
    x = problem.x
    stacked = [np.concatenate([s.get(0, np.zeros(210)), s.get(1, np.zeros(130))]) for s in (a, b)]
    u, v = (s - x @ np.linalg.lstsq(x, s, rcond=None)[0] for s in stacked)
    wanted = u @ v / np.linalg.norm(u) / np.linalg.norm(v)
    assert evidence.likeness(a, b) == pytest.approx(wanted, rel=1e-9)
    assert evidence.likeness(b, a) == pytest.approx(wanted, rel=1e-9)
    assert evidence.likeness(b, {1: -2.0 * b[1]}) == pytest.approx(-1.0, rel=1e-9)
    assert evidence.likeness({0: a[0]}, {1: a[1]}) == pytest.approx(
        evidence.likeness({1: a[1]}, {0: a[0]}), rel=1e-9
    )  # through the shared parameters alone


def test_smallest_amplitude_gains_what_is_needed():
    problem = Problem(2, k=2)
    evidence = problem.evidence()
    for column in range(2):
        amplitude = evidence.smallest(problem.products(evidence), column, 7.0)
        assert left(problem.x, problem.c[:, column] * amplitude) == pytest.approx(7.0, rel=1e-9)


def test_baseline_with_columns_that_depend_on_each_other():
    problem = Problem(3)
    whole = Problem(3)
    whole.columns[0][:, 2] = whole.columns[0][:, 0] - 2 * whole.columns[0][:, 1]
    whole.columns[1][:, 1] = 0.0  # parameter 4 is then seen through channel 0 only, where it is no news
    evidence = whole.evidence()
    gain = evidence.gain(whole.products(evidence), *FREE)
    both = np.hstack([whole.x, whole.c])
    assert np.linalg.matrix_rank(whole.x) == N_PARAMETERS
    assert gain.total == pytest.approx(left(whole.x, whole.y) - left(both, whole.y), rel=1e-8)
    whole.index[1], whole.columns[1] = np.array([2, 3]), problem.columns[1][:, :2]
    evidence = whole.evidence()
    assert np.linalg.matrix_rank(whole.x) == N_PARAMETERS - 1
    gain = evidence.gain(whole.products(evidence), *FREE)
    both = np.hstack([whole.x, whole.c])
    assert gain.total == pytest.approx(left(whole.x, whole.y) - left(both, whole.y), rel=1e-8)
    check_fresh(whole, FREE)


def test_candidate_columns_that_are_alike_count_once():
    problem = Problem(4, k=1)
    evidence = problem.evidence()
    one = evidence.gain(problem.products(evidence), FREE[0][:1], FREE[1][:1])
    twice = evidence.products([(k, np.hstack([c, 3 * c])) for k, c in enumerate(problem.candidate)])
    for bounds in (FREE, (np.array([0.0, 0.0]), np.array([0.1, np.inf]))):
        assert evidence.gain(twice, *bounds).total == pytest.approx(one.total, rel=1e-6)
    np.testing.assert_allclose(
        evidence.null_gains(twice), evidence.null_gains(problem.products(evidence)), rtol=1e-6, atol=1e-9
    )


def test_a_column_that_the_baseline_can_mimic_gains_nothing():
    problem = Problem(6, k=1)
    problem.candidate = [
        x[:, i == 4] + 1e-3 * np.random.default_rng(9).normal(size=(len(x), 1))
        for i, x in zip(problem.index, problem.columns, strict=True)
    ]
    evidence = problem.evidence()
    gain = evidence.gain(problem.products(evidence), FREE[0][:1], FREE[1][:1])
    assert gain.total == 0.0
    assert gain.unabsorbed < 1e-5


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_units_do_not_matter(scale):
    problem = Problem(0)
    evidence = problem.evidence()
    wanted = evidence.gain(problem.products(evidence), *FREE)
    sizes = scale ** np.arange(3)
    problem.columns[0] = problem.columns[0] * sizes
    problem.columns[1] = problem.columns[1] * np.array([1.0, sizes[2], 1.0, sizes[1]])
    problem.candidate = [c * [1.0, scale] for c in problem.candidate]
    evidence = problem.evidence()
    gain = evidence.gain(problem.products(evidence), *FREE)
    assert gain.total == pytest.approx(wanted.total, rel=1e-6)
    np.testing.assert_allclose(gain.amplitudes * [1.0, scale], wanted.amplitudes, rtol=1e-6)


def test_candidates_summed_at_once_gain_alone_what_each_regression_does():
    """A grid of three candidates of two columns, each beside one more that may not be negative (NNLS by SciPy)."""
    problem, rng = Problem(5), np.random.default_rng(11)
    evidence = problem.evidence()
    grid = [[rng.normal(size=c.shape) + 0.2 * c for c in problem.candidate] for _ in range(3)]
    beside = {k: rng.normal(size=(len(c), 1)) - 0.1 * c[:, :1] for k, c in enumerate(problem.candidate)}
    held = {0: [beside[0]], 1: [beside[1]]}
    samples = Samples(evidence, evidence, lambda _, parts: np.concatenate(parts), lambda _, p: np.concatenate(p), held)
    variants: Any = [SimpleNamespace(low=FREE[0], high=FREE[1])] * 3
    cases = samples.cases([(v, {k: [x] for k, x in enumerate(c)}) for v, c in zip(variants, grid, strict=True)])
    other = np.concatenate([beside[0], beside[1]])
    alone = bounded(problem.x, other, problem.y, np.zeros(1), np.full(1, np.inf))[1]
    for case, columns in zip(cases, grid, strict=True):
        for some in (np.array([0, 1]), np.array([1])):
            c = np.hstack([np.concatenate(columns)[:, some], other])
            low = np.r_[np.full(len(some), -np.inf), 0.0]
            expected = alone - bounded(problem.x, c, problem.y, low, np.full(len(low), np.inf))[1]
            assert case.only(some).gain().total == pytest.approx(expected, rel=1e-6)
