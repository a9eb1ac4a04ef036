"""Covariance of a channel's residual: against the dense matrix of its formula, and against noise that was drawn."""

import numpy as np
import pytest
from scipy.signal import lfilter

from snarelab.identification.nuisance.covariance import Covariance, FirstOrderNoise

STEP = 0.02
PARTS = (slice(0, 37), slice(40, 41), slice(41, 90))
"""Runs without a gap; samples 37 to 39 stand in none, and remember nothing."""


def dense(variance, processes, derivative, segments):
    """K entry by entry: exponentials within a run, and the product of b with the second differences' covariance."""
    n = len(variance)
    k = np.diag(variance)
    run = np.full(n, -1)
    for number, s in enumerate(segments):
        run[s] = number
    t = STEP * np.arange(n)
    same = run[:, None] == run[None, :]
    for p in processes:
        k += p.level**2 * same * np.exp(-np.abs(t[:, None] - t) / p.time)
    if derivative is not None:
        difference = np.zeros((n, n))
        for s in segments:
            for i in range(s.start, s.stop):
                for lag, weight in enumerate((1.0, -2.0, 1.0)):
                    if i - lag >= s.start:
                        difference[i, i - lag] = weight / np.sqrt(6)
        k += derivative[:, None] * (difference @ difference.T) * derivative
    return k


def some(seed, n=90):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.3, 2.0, n), rng.uniform(0.0, 1.5, n), rng.normal(size=(n, 3))


KINDS = {
    "independent": ((), False),
    "coloured": ((FirstOrderNoise(0.7, 0.1),), False),
    "coloured and wandering": ((FirstOrderNoise(0.7, 0.1), FirstOrderNoise(2.0, 8.0)), False),
    "encoders": ((), True),
    "all": ((FirstOrderNoise(0.7, 0.1), FirstOrderNoise(0.0, 1.0), FirstOrderNoise(2.0, 8.0)), True),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("segments", [(slice(0, 90),), (slice(0, 37), slice(37, 38), slice(38, 90))])
def test_solutions_and_determinant_are_those_of_the_dense_matrix(kind, segments):
    processes, encoders = KINDS[kind]
    variance, b, x = some(1)
    b = b if encoders else None
    k = dense(variance, processes, b, segments)
    found = Covariance(variance, processes, b, STEP, segments)
    np.testing.assert_allclose(found.solve(x), np.linalg.solve(k, x), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.solve(x[:, 0]), np.linalg.solve(k, x[:, 0]), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found.gram(x), x.T @ np.linalg.solve(k, x), rtol=1e-9, atol=1e-10)
    assert found.log_det == pytest.approx(np.linalg.slogdet(k)[1], rel=1e-11)
    np.testing.assert_allclose(found.dense(), k, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("segments", [(slice(0, 90),), PARTS])
def test_columns_made_white_have_the_products_of_the_dense_inverse(kind, segments):
    processes, encoders = KINDS[kind]
    variance, b, _ = some(2)
    x, y = np.random.default_rng(3).normal(size=(2, 90, 7))
    found = Covariance(variance, processes, b if encoders else None, STEP, segments)
    wanted = x.T @ np.linalg.solve(dense(variance, processes, b if encoders else None, segments), y)
    if segments is PARTS:  # outside every run a sample is like one in a run of its own: compared with `solve`
        wanted = x.T @ found.solve(y)
    np.testing.assert_allclose(found.white(x).T @ found.white(y), wanted, rtol=1e-8, atol=1e-9)


def test_a_process_of_no_level_and_no_derivative_are_none():
    variance, _, x = some(4)
    found = Covariance(variance, [FirstOrderNoise(0.0, 1.0)], np.zeros(90), STEP, PARTS)
    np.testing.assert_allclose(found.solve(x), x / variance[:, None], rtol=1e-14)
    assert found.log_det == pytest.approx(np.log(variance).sum(), rel=1e-14)


def test_noise_that_was_drawn_has_unit_variance_once_it_is_whitened():
    """White, an autoregression drawn by its recursion, and a second difference: r' K⁻¹ r is chi squared (n)."""
    rng, n = np.random.default_rng(5), 4000
    decay = np.exp(-STEP / 0.1)
    news = rng.normal(size=n) * np.sqrt(1 - decay**2)
    news[0] /= np.sqrt(1 - decay**2)
    coloured = np.asarray(lfilter([1.0], [1.0, -decay], news))
    b = 1 + 0.5 * np.sin(np.arange(n) / 50)
    encoders = b * np.convolve(rng.normal(size=n), [1.0, -2.0, 1.0])[:n] / np.sqrt(6)
    r = 0.5 * rng.normal(size=n) + 1.2 * coloured + encoders
    own = Covariance(np.full(n, 0.25), [FirstOrderNoise(1.2, 0.1)], b, STEP, (slice(0, n),))
    assert r @ own.solve(r) / n == pytest.approx(1.0, abs=4 * np.sqrt(2 / n))
    white = Covariance(np.full(n, float(np.var(r))), [], None, STEP, (slice(0, n),))
    likelihood = [-0.5 * (r @ k.solve(r) + k.log_det) for k in (own, white)]
    assert likelihood[0] > likelihood[1] + 500
