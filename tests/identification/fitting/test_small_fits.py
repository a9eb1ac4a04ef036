"""Parts of the joint fit by hand: gathering columns, RMS of what counts, weights, and the covariance of clusters."""

from dataclasses import replace
from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from moving_arm import exact

from snarelab.identification.fitting import fit as module
from snarelab.identification.fitting.assembly import Block
from snarelab.identification.fitting.experiment import Experiment
from snarelab.identification.fitting.fit import _covariance, _reweighted, channel_rms, fit
from snarelab.identification.fitting.problem import Problem, gather

PERIOD = 0.1
"""Five samples in half a second."""


def run(tau, segments=None, silent=()) -> Any:
    tau = np.array(tau, float, order="F")
    t = PERIOD * np.arange(len(tau))
    names = tuple(f"joint{k + 1}" for k in range(tau.shape[1]))
    motion = replace(exact(names, PERIOD, 1, (t, 0 * tau, 0 * tau, 0 * tau, tau), segments), silent=silent)
    none: Any = None
    return Experiment(motion, none)


def linear(*columns) -> Any:
    """A model of these columns (n, k), all for theta, one array a channel."""
    index = [np.arange(x.shape[1]) for x in columns]

    def evaluate(_experiment: Any, theta: Any) -> Any:
        tau = np.stack([x @ theta[i] for x, i in zip(columns, index, strict=True)], 1)
        blocks = [Block(c, i, x) for c, (x, i) in enumerate(zip(columns, index, strict=True))]
        return Made(tau=tau, blocks=blocks)

    return Made(evaluate=evaluate, torque=lambda e, theta: evaluate(e, theta).tau)


def test_blocks_of_one_channel_are_put_side_by_side():
    a, b = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0], [6.0]])
    none = Block(0, np.zeros(0, int), np.zeros((2, 0)))
    blocks = [Block(0, np.array([4, 1]), a), Block(1, np.array([0]), 9 * b), none, Block(0, np.array([2]), b)]
    index, columns = gather(blocks, 0)
    assert index.tolist() == [4, 1, 2]
    np.testing.assert_array_equal(columns, [[1, 2, 5], [3, 4, 6]])
    index, columns = gather(blocks, 2)
    assert (len(index), columns.shape) == (0, (0, 0))


def test_a_parameter_that_stands_in_several_blocks_has_the_sum_of_its_columns():
    a, b = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, 7.0], [6.0, 8.0]])
    index, columns = gather([Block(0, np.array([4, 1]), a), Block(0, np.array([1, 3]), b)], 0)
    assert index.tolist() == [1, 3, 4]
    np.testing.assert_array_equal(columns, [[2 + 5, 7, 1], [4 + 6, 8, 3]])


def test_cost_gradient_and_normal_matrix_of_two_weighted_channels():
    """Residuals (1, 2) and (3, 0) by 1 and 2: ½(5 + 9/4); columns ones, and (1, 0) by 2."""
    e = run([[1.0, 3.0], [2.0, 0.0]])
    model = linear(np.array([[1.0], [1.0]]), np.array([[1.0], [0.0]]))
    problem = Problem(model, (e,), np.array([0, 1]), np.array([0]))
    found = problem.normal(np.zeros(1), np.array([1.0, 2.0]))
    assert found.cost == pytest.approx(0.5 * (5 + 9 / 4))
    np.testing.assert_allclose(found.gradient, [-(3 + 3 / 4)])
    np.testing.assert_allclose(found.matrix, [[2 + 1 / 4]])
    twice = Problem(model, (e, e), np.array([1]), np.array([0])).normal(np.ones(1), np.array([2.0]))
    assert twice.cost == pytest.approx(2 * 0.5 * 4 / 4)
    np.testing.assert_allclose(twice.gradient, [-2 * 2 / 4])
    np.testing.assert_allclose(problem.rms(np.ones(1)), np.sqrt([0.5, 2.0]))  # residuals (0, 1) and (2, 0)
    assert np.isinf(problem.normal(np.array([1e200]), np.array([1e-100, 1.0])).cost)


def test_rms_of_residual_and_measurement_over_the_samples_that_count():
    first, second = run([[3.0, 1.0, 0.0], [5.0, 1.0, 0.0]]), run([[4.0, 7.0, 0.0]])
    model = Made(torque=lambda e, _: 0 * e.motion.tau + [1.0, 1.0, 0.0])
    left, size = channel_rms(model, [first, second], np.zeros(0))  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(left, np.sqrt([(4 + 16 + 9) / 3, 36 / 3, 0]))
    np.testing.assert_allclose(size, np.sqrt([50 / 3, 51 / 3, 0]))
    some = replace(first, kept=np.array([[True, False, False], [False, True, False]]))
    left, size = channel_rms(model, [some], np.zeros(0))  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(left, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(size, [3.0, 1.0, 0.0])


def test_a_channel_that_is_silent_in_all_counts_as_large_as_the_largest():
    model: Any = Made(torque=lambda e, _: 0 * e.motion.tau)
    recordings = [run([[3.0, 0.1, 0.1]], silent=(1, 2)), run([[3.0, 0.1, 2.0]], silent=(1,))]
    _, size = channel_rms(model, recordings, np.zeros(0))
    np.testing.assert_allclose(size, [3.0, 3.0, np.sqrt((0.01 + 4.0) / 2)])


class Weighted:
    """RMS residuals after each fit; the weights that each was given are kept."""

    def __init__(self, *rms):
        self.left, self.given = [np.array(r) for r in rms], []

    def minimise(self, theta, sigma):
        self.given.append(sigma)
        return Made(theta=theta + 1)

    def rms(self, theta):
        return self.left[int(theta[0]) - 1]


@pytest.mark.parametrize(
    ("rms", "fits"),
    [
        ([(1.019, 0.981)], 1),  # within a fiftieth of what was given
        ([(1.021, 1.0), (1.021, 1.0)], 2),
        ([(1.0, 0.5), (1.0, 0.5)], 2),
        ([(2.0, 1.0), (3.0, 1.0), (3.0, 1.01)], 3),
        ([(k + 1.0, 1.0) for k in range(1, 9)], 5),  # five at most
    ],
)
def test_weights_follow_the_residuals_until_they_settle(rms, fits):
    problem: Any = Weighted(*rms)
    assert _reweighted(problem, np.zeros(1), np.ones(2))[0] == fits
    np.testing.assert_allclose(problem.given, [(1.0, 1.0), *rms[: fits - 1]])


def test_one_channel_needs_no_weight():
    problem: Any = Weighted()
    assert _reweighted(problem, np.zeros(1), np.ones(1))[0] == 1


@pytest.mark.parametrize(
    ("residual", "segments", "variance"),
    [
        # A mean of ten: squared sums of half seconds over 10², times clusters over one less.
        ([*5 * [1], *5 * [-1]], None, (25 + 25) / 100 * 2),
        ([1, 2, 3, 4, 5, 1, 1, 1, 1, 1], None, (15**2 + 5**2) / 100 * 2),
        ([*4 * [1], -2, *5 * [1]], (slice(0, 4), slice(4, 10)), (4**2 + 2**2 + 1**2) / 100 * 3 / 2),
        ([*7 * [1], *3 * [-1]], (slice(0, 7), slice(7, 10)), (5**2 + 2**2 + 3**2) / 100 * 3 / 2),
        (10 * [1], (slice(0, 0), slice(0, 10)), (25 + 25) / 100 * 2),  # a run of which the band left nothing
    ],
)
@pytest.mark.parametrize("sigma", [1.0, 3.0])
def test_the_covariance_of_a_mean_is_that_of_its_half_seconds(residual, segments, variance, sigma):
    model = linear(np.ones((10, 1)))
    e = run(np.array(residual, float)[:, None] + 4.0, segments)
    covariance, std, condition = _covariance(model, [e], np.array([4.0]), np.array([sigma]))
    assert covariance[0, 0] == pytest.approx(variance)
    assert std[0] == pytest.approx(np.sqrt(variance))
    assert condition == pytest.approx(1.0)


def test_directions_that_the_data_do_not_show_make_their_parameters_unknown():
    """The second and third column are one; the fourth is nothing."""
    one, two = np.array([1.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    columns = np.stack([one, two, 2 * two, 0 * one], 1)
    e = run(np.array([[1.0], [-1.0], [2.0], [1.0]]))
    covariance, std, _ = _covariance(linear(columns), [e, e], np.zeros(4), np.ones(1))
    # One cluster a recording, with sums (0, 3): nothing scatters along the first.
    assert std[0] == pytest.approx(0.0, abs=1e-9)
    assert np.isinf(std[1:]).all()
    assert covariance[1, 1] + 2 * covariance[1, 2] * 2 + 4 * covariance[2, 2] == pytest.approx(2 * 9 / 16 * 2)


@pytest.mark.parametrize("cosine", [0.0, 0.6, -0.8])
def test_the_condition_is_that_of_columns_of_unit_length(cosine):
    """√((1 + |c|) / (1 - |c|)) for two columns at an angle, however long they are."""
    columns = np.array([[1.0, 5 * cosine], [0.0, 5 * np.sqrt(1 - cosine**2)]])
    found = _covariance(linear(columns), [run(np.ones((2, 1)))], np.zeros(2), np.ones(1))[2]
    assert found == pytest.approx(np.sqrt((1 + abs(cosine)) / (1 - abs(cosine))))
    nothing = _covariance(linear(np.zeros((2, 0))), [run(np.ones((2, 1)))], np.zeros(0), np.ones(1))
    assert (nothing[0].shape, nothing[1].shape, nothing[2]) == ((0, 0), (0,), 1.0)


@pytest.mark.parametrize(
    ("answers", "starts", "agreed"),
    [([(3, 3), (5, 2)], 5, 2), ([(5, 2), (3, 3)], 5, 2), ([(1, 1), (1, 0)], 1, 1)],
)
def test_a_fit_tells_the_part_that_took_most_starts_and_what_lies_at_a_bound(monkeypatch, answers, starts, agreed):
    """Ends 2, 1 + 1e-9, 5 and 1 + 1e-3 between bounds of 1 and 2 for all but the third, which has none."""
    ends = np.array([2.0, 1 + 1e-9, 5.0, 1 + 1e-3])
    low, high = np.array([1.0, 1.0, -np.inf, 1.0]), np.array([2.0, 2.0, np.inf, 2.0])
    model: Any = Made(low=low, high=high, start=np.full(4, 1.5))
    parts = [Made(index=np.array(i), channels=np.array([c])) for c, i in enumerate([[0, 2], [1, 3]])]
    told, begun = iter(answers), []

    def best(_problem: Any, here: Any, weights: Any, _rng: Any) -> Any:
        begun.append((here.tolist(), weights.tolist()))
        return here, *next(told)

    monkeypatch.setattr(module, "split", lambda *_: parts)
    monkeypatch.setattr(module, "best_start", best)
    monkeypatch.setattr(module, "_reweighted", lambda p, *_: ends[p.index])
    monkeypatch.setattr(module, "channel_rms", lambda *_: (np.ones(2), np.ones(2)))
    monkeypatch.setattr(module, "_covariance", lambda *_: (np.eye(4), np.ones(4), 1.0))
    words = []
    found = fit(model, [run([[3.0, 1.0], [1.0, 1.0]])], start=np.array([9.0, 1.2, 9.0, -9.0]), progress=words.append)
    np.testing.assert_array_equal(found.theta, ends)
    assert found.at_bound.tolist() == [True, True, False, False]
    assert (found.starts, found.agreed) == (starts, agreed)
    # A start is moved between the bounds; channels weigh by the RMS of what was measured, √5 and 1.
    assert [x for x, _ in begun] == [[2.0, 9.0], [1.2, 1.0]]
    assert [x[0] for _, x in begun] == pytest.approx([np.sqrt(5.0), 1.0])
    assert words == [f"starting values, {k} of 2 independent parts" for k in (1, 2)]
    alone = fit(model, [run([[3.0, 1.0]])], multi_start=False)
    assert (alone.starts, alone.agreed) == (1, 1)
