"""A periodogram against scipy's, and with coloured noise against dense algebra; trial lengths and peaks by hand."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lombscargle

from snarelab.identification.fitting.periodogram import (
    MOST_PEAKS,
    SampledSignal,
    peaks,
    periodogram,
    trial_waves,
)


def as_it_is(columns):
    return columns


def pairs_by(inverse):
    """C'K⁻¹C of each pair of columns."""

    def of(x, y):
        pairs = [np.stack(pair, 1) for pair in zip(x.T, y.T, strict=True)]
        return np.array([pair.T @ inverse @ pair for pair in pairs], float)

    return of


def swing(n=400, seed=3):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 9.0, n)
    return 1.7 * np.sin(1.1 * t) + 0.6 * np.sin(2.3 * t + 1.0), rng


def test_with_white_noise_it_is_scipys_lomb_scargle():
    q, rng = swing()
    r = np.cos(2 * np.pi * 5.43 * q + 0.7) + rng.normal(size=len(q))
    waves = np.arange(0.6, 9.0, 0.07)
    run = SampledSignal(q, as_it_is, r, pairs_by(np.eye(len(q))))
    known = lombscargle(q, r, 2 * np.pi * waves)
    power = periodogram(waves, [run])
    np.testing.assert_allclose(power, 2 * known, rtol=1e-8)
    assert waves[np.argmax(power)] == pytest.approx(5.43, abs=1 / np.ptp(q))


def test_with_coloured_noise_of_two_recordings_it_is_twice_the_gain_of_log_likelihood():
    """Dense K, r'K⁻¹r before and after a weighted fit of both columns, over recordings of different length."""
    waves, runs, dense = np.array([1.5, 1.9, 2.3]), [], []
    for n, seed in ((80, 1), (120, 2)):
        q, rng = swing(n, seed)
        k = 0.5 * np.eye(n) + toeplitz(np.exp(-np.arange(n) / 7))
        r, inverse = rng.normal(size=n), np.linalg.inv(k)
        runs.append(SampledSignal(q, lambda c: 3 * c, inverse @ r, pairs_by(inverse)))
        dense.append((q, r, np.linalg.cholesky(inverse).T))
    for w, power in zip(waves, periodogram(waves, runs), strict=True):
        white = np.concatenate([half @ r for _, r, half in dense])
        both = np.concatenate([half @ np.stack([np.cos(2 * np.pi * w * q), np.sin(2 * np.pi * w * q)], 1)
                               for q, _, half in dense])  # fmt: skip
        left = white - both @ np.linalg.lstsq(both, white, rcond=None)[0]
        assert power == pytest.approx(white @ white - left @ left, rel=1e-8)


def test_a_signal_that_tells_cosine_and_sine_not_apart_has_no_power():
    q = np.zeros(30)
    assert periodogram(np.array([1.0, 2.0]), [SampledSignal(q, as_it_is, np.ones(30), pairs_by(np.eye(30)))]).max() == 0


def test_trial_lengths_go_from_the_longest_to_two_samples_a_third_of_an_element_apart():
    """A travel of 2 in steps of 0.01: half a wave is 0.01, so 1/0.02 = 50 waves at most; elements are 1/2 wide."""
    waves = trial_waves([np.arange(0.0, 1.0, 0.01), np.arange(0.99, 2.005, 0.01)], 1e-3, 1.0)
    assert waves[0] == 1.0
    assert np.diff(waves) == pytest.approx(1 / 6)
    assert waves[-1] == pytest.approx(50.0, abs=0.2)
    assert trial_waves([np.arange(0.0, 2.005, 0.01)], 0.1, 1.0)[-1] == pytest.approx(10.0, abs=0.2)
    assert not len(trial_waves([np.full(9, 0.3)], 0.1, 1.0))


def test_peaks_are_the_highest_tops_in_order_ends_included():
    waves = np.arange(1.0, 9.0)
    found = peaks(waves, np.array([5.0, 1.0, 2.0, 1.0, 9.0, 8.0, 8.5, 7.0]))
    assert found.waves.tolist() == [1.0, 3.0, 5.0, 7.0]
    assert (found.best, found.step, found.trials) == (2, 1.0, 8)
    many = peaks(np.arange(1.0, 41.0), np.tile([0.0, 1.0], 20) * np.arange(40.0))
    assert many.waves.tolist() == [float(w) for w in range(40 - 2 * (MOST_PEAKS - 1), 41, 2)]
    assert peaks(np.array([2.0]), np.array([1.0])).waves.tolist() == [2.0]


def test_lines_stand_above_what_the_highest_of_a_continuums_trials_reaches():
    """Median 1.5 of forty trials: 1.5 ln 40 / ln 2 = 7.98. In draws of a continuum the highest is there on average."""
    power = np.tile([1.0, 2.0], 20)
    assert not len(peaks(np.arange(1.0, 41.0), power, lines=True).waves)
    power[[7, 21]] = 7.9, 8.1
    found = peaks(np.arange(1.0, 41.0), power, lines=True)
    assert (found.waves.tolist(), found.best) == ([22.0], 0)
    drawn = np.random.default_rng(0).exponential(33.0, (400, 391))
    several = [len(peaks(np.arange(1.0, 392.0), x, lines=True).waves) for x in drawn]
    assert 0.5 < np.mean(several) < 1.5
