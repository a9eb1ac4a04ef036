"""The standard error of a held-out gain, against the deviation of the gain itself on many draws."""

import numpy as np
import pytest
from scipy.stats import t as student

from snarelab.identification.deciding import GATE
from snarelab.identification.evidence.gain import Remaining, scatter, standard_error
from snarelab.identification.nuisance.covariance import Covariance

N_BLOCKS, LENGTH = 16, 40
N_DRAWS = 2000


def gains(
    d: np.ndarray, rng: np.random.Generator, share: float = 1.0, noise: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Gain and expected gain of each block: white noise that is said to be of one, a law of which a share is true."""
    r = share * d + noise * rng.normal(size=d.shape)
    return (r * d - d**2 / 2).sum(axis=1), (d**2 / 2).sum(axis=1)


def deviations(d: np.ndarray, share: float, noise: float) -> tuple[float, float]:
    """What is told of the sum's deviation, on average over many draws, and what that is."""
    rng = np.random.default_rng(1)
    drawn = [gains(d, rng, share, noise) for _ in range(4000)]
    return float(np.mean([standard_error(g, e) for g, e in drawn])), float(np.std([g.sum() for g, _ in drawn]))


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
@pytest.mark.parametrize("noise", [1.0, 4.0])
def test_is_the_deviation_of_the_sum_whatever_the_noise_is_said_to_be(share, noise):
    told, true = deviations(np.full((N_BLOCKS, LENGTH), 0.3), share, noise)
    assert told == pytest.approx(true, rel=0.05)


def test_is_the_usual_one_where_blocks_are_alike():
    g, e = gains(np.full((N_BLOCKS, LENGTH), 0.3), np.random.default_rng(1))
    assert standard_error(g, e) == pytest.approx(np.std(g, ddof=1) * np.sqrt(N_BLOCKS), rel=1e-9)


def test_a_block_that_holds_most_does_not_double_the_error():
    """Of six blocks one holds three quarters of what is expected; a jackknife leaves it out, and tells too much."""
    d = np.full((6, LENGTH), 0.1)
    d[0] = 0.45
    told, true = deviations(d, 1.0, 1.0)
    assert told == pytest.approx(true, rel=0.15)


def passed(d: np.ndarray, share: float) -> float:
    """Share of draws in which the gain is beyond the gate."""
    rng = np.random.default_rng(4)
    drawn = [gains(d, rng, share) for _ in range(N_DRAWS)]
    return float(np.mean([g.sum() > GATE * standard_error(g, e) for g, e in drawn]))


@pytest.mark.parametrize("n_blocks", [2, 3, 5, 8, 16])
def test_how_often_nothing_gained_passes_the_gate(n_blocks):
    """A law of which half is true gains nothing on average. Its gain in standard errors follows Student's t of one
    degree fewer than blocks, not a normal distribution with 2.3 % beyond the gate.

    Blocks               2       3       5       8      16
    Student          14.8 %   9.2 %   5.8 %   4.3 %   3.2 %
    blocks alike     15.5 %   9.5 %   6.5 %   4.0 %   4.0 %
    one holds most   14.8 %   9.6 %   6.8 %   5.4 %   3.8 %
    nothing is true   5.4 %   3.4 %   1.6 %   0.6 %   0.8 %

    The last is a law that fits noise: it is expected to gain one unit of log density less than nothing.
    """
    alike = np.full((n_blocks, LENGTH), 0.3)
    uneven = alike.copy()
    uneven[0] *= np.sqrt(3 * (n_blocks - 1))  # three quarters of what is expected
    fitted = alike * np.sqrt(2 / np.sum(alike**2))
    level = float(student.sf(GATE, n_blocks - 1))
    chance = np.sqrt(level * (1 - level) / N_DRAWS)
    assert passed(alike, 0.5) == pytest.approx(level, abs=4 * chance)
    # Where one block holds most, it says most of the dispersion too, and there are as good as fewer blocks.
    assert level - 4 * chance < passed(uneven, 0.5) < 1.5 * level + 4 * chance
    assert passed(fitted, 0.0) < 0.5 * level


@pytest.mark.parametrize(("noise", "times"), [(1.0, 5.0), (3.0, 1.5)])
def test_a_law_that_acts_in_few_blocks_is_as_sure_as_its_noise_lets_it(noise, times):
    """Three blocks of sixteen hold nearly all of it: the plain standard error of a sum is six times the deviation."""
    d = 0.05 * np.ones((N_BLOCKS, LENGTH))
    d[3:6] = np.array([1.5, 2.0, 2.5])[:, None]
    told, true = deviations(d, 1.0, noise)
    assert told == pytest.approx(true, rel=0.25)
    rng = np.random.default_rng(2)
    plain = np.mean([np.std(gains(d, rng, 1.0, noise)[0], ddof=1) for _ in range(400)]) * np.sqrt(N_BLOCKS)
    assert plain > times * true


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
