"""The standard error of a held-out gain, against the deviation of the gain itself on many draws."""

import numpy as np
import pytest

from snarelab.identification.evidence.gain import Remaining, scatter, standard_error
from snarelab.identification.nuisance.covariance import Covariance

N_BLOCKS, LENGTH = 16, 40


def gains(d: np.ndarray, rng: np.random.Generator, share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Gain and expected gain of each block: white noise of one, a law of which a share is true."""
    r = share * d + rng.normal(size=d.shape)
    return (r * d - d**2 / 2).sum(axis=1), (d**2 / 2).sum(axis=1)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_is_the_deviation_of_the_sum_where_blocks_are_alike(share):
    rng = np.random.default_rng(1)
    d = np.full((N_BLOCKS, LENGTH), 0.3)
    drawn = [gains(d, rng, share) for _ in range(4000)]
    told = np.mean([standard_error(g, e) for g, e in drawn])
    assert told == pytest.approx(np.std([g.sum() for g, _ in drawn]), rel=0.05)
    # And then it is the usual one.
    g, e = drawn[0]
    assert standard_error(g, e) == pytest.approx(np.std(g, ddof=1) * np.sqrt(N_BLOCKS), rel=1e-9)


def test_a_law_that_acts_in_few_blocks_is_as_sure_as_its_noise_lets_it():
    """Three blocks of sixteen hold nearly all of it: the plain standard error of a sum is six times the deviation."""
    rng = np.random.default_rng(2)
    d = 0.05 * np.ones((N_BLOCKS, LENGTH))
    d[3:6] = np.array([1.5, 2.0, 2.5])[:, None]
    drawn = [gains(d, rng) for _ in range(4000)]
    deviation = np.std([g.sum() for g, _ in drawn])
    assert np.mean([standard_error(g, e) for g, e in drawn]) == pytest.approx(deviation, rel=0.25)
    assert np.mean([np.std(g, ddof=1) * np.sqrt(N_BLOCKS) for g, _ in drawn]) > 5 * deviation


def test_a_law_that_is_true_in_one_block_alone_is_not_sure():
    """Its other block, of half the energy, contradicts it."""
    d = np.zeros((4, LENGTH))
    d[0], d[1] = 1.0, 0.7
    d[2:] = 0.01
    r = d.copy()
    r[1] = 0.0
    g, e = (r * d - d**2 / 2).sum(axis=1), (d**2 / 2).sum(axis=1)
    assert g.sum() > 0
    assert g.sum() < standard_error(g, e)


def test_nothing_tells_how_a_law_of_one_block_would_gain_elsewhere():
    assert standard_error(np.array([5.0, 0.0, 0.0]), np.array([5.0, 0.0, 0.0])) == np.inf
    assert standard_error(np.zeros(3), np.zeros(3)) == np.inf
    assert standard_error(np.array([5.0]), np.array([5.0])) == np.inf


def test_blocks_of_two_recordings_and_channels_count_together():
    rng = np.random.default_rng(3)
    r, d = rng.normal(size=(2, 60, 3)), rng.normal(size=(2, 60, 3))
    white = Covariance(np.full(60, 4.0), (), None, 0.01, [slice(0, 60)])
    without = [Remaining.of(list(x.T), [white] * 3) for x in r]
    with_it = [Remaining.of(list(x.T), [white] * 3) for x in r - d]
    found = scatter(without, with_it, [lambda x: x.reshape(6, 10).sum(axis=1)] * 2)
    gained = (r**2 - (r - d) ** 2).sum(axis=2).reshape(12, 10).sum(axis=1) / 8
    expected = (d**2).sum(axis=2).reshape(12, 10).sum(axis=1) / 8
    assert found == pytest.approx(standard_error(gained, expected), rel=1e-9)


def test_what_remains_of_some_samples():
    """The others count as if nothing had been measured there."""
    left = Remaining(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[0.5, 1.0], [1.0, 2.0]]))
    np.testing.assert_array_equal(left.energy, [2.5, 11.0])
    np.testing.assert_array_equal(left.at(np.array([[1.0], [0.0]])).energy, [2.5, 0.0])
