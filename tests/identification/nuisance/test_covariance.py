"""Covariance of a channel's residual: against the dense matrix of its formula, and against noise that was drawn."""

import numpy as np
import pytest
from scipy.signal import lfilter

from snarelab.identification.nuisance import innovations
from snarelab.identification.nuisance.covariance import Covariance, LaggedNoise

STEP = 0.02
PARTS = (slice(0, 37), slice(40, 41), slice(41, 90))
"""Runs without a gap; samples 37 to 39 stand in none, and remember nothing."""


@pytest.fixture(autouse=True, params=["C", "NumPy"])
def loops(request, monkeypatch):
    """Every test with a compiler and without one."""
    if request.param == "NumPy":
        monkeypatch.setattr(innovations, "_compiled", lambda: None)
    else:
        assert innovations.compiles()


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
        lags, decay = np.abs(t[:, None] - t) / STEP, np.exp(-STEP / p.time)
        # Two lags in a row: the sum of the products of their impulse responses, k ρ^k, in closed form; of a vibration,
        # ρ^k sin((k + 1) ω) / sin ω.
        shape = 1 + lags * (1 - decay**2) / (1 + decay**2) if p.order == 2 else 1.0
        if p.frequency:
            w = 2 * np.pi * p.frequency * STEP
            shape = np.cos(lags * w) + np.sin(lags * w) / np.tan(w) * (1 - decay**2) / (1 + decay**2)
        level = np.broadcast_to(p.level, n)
        k += level[:, None] * level * same * decay**lags * shape
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
    "coloured": ((LaggedNoise(0.7, 0.1),), False),
    "coloured and wandering": ((LaggedNoise(0.7, 0.1), LaggedNoise(2.0, 8.0)), False),
    "encoders": ((), True),
    "smooth": ((LaggedNoise(0.7, 0.1, 2),), False),
    "smooth and wandering": ((LaggedNoise(2.0, 8.0), LaggedNoise(0.7, 0.1, 2)), False),
    "smooth, wandering, encoders": ((LaggedNoise(0.7, 0.1, 2), LaggedNoise(2.0, 8.0)), True),
    "vibrating": ((LaggedNoise(0.7, 0.4, 2, 3.1),), False),
    "vibrating now and then": ((LaggedNoise(np.linspace(0.0, 2.0, 90), 0.4, 2, 3.1), LaggedNoise(0.7, 0.1)), True),
    "all": ((LaggedNoise(0.7, 0.1), LaggedNoise(0.0, 1.0), LaggedNoise(2.0, 8.0)), True),
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
    pairs = [x[:, [0, 2]].T @ np.linalg.solve(k, x[:, [0, 2]]), x[:, [1, 0]].T @ np.linalg.solve(k, x[:, [1, 0]])]
    np.testing.assert_allclose(found.pair_grams(x[:, [0, 1]], x[:, [2, 0]]), pairs, rtol=1e-9, atol=1e-10)
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


def test_densities_of_samples_add_up_to_that_of_all():
    variance, encoders, x = some(4)
    for processes in ((), (LaggedNoise(2.0, 8.0), LaggedNoise(0.7, 0.4, 2, 3.1))):
        own = Covariance(variance, processes, encoders if processes else None, STEP, PARTS)
        every = own.log_density(x[:, 0])
        whole = -0.5 * (x[:, 0] @ own.solve(x[:, 0]) + own.log_det + 90 * np.log(2 * np.pi))
        assert every.shape == (90,)
        assert every.sum() == pytest.approx(whole, rel=1e-10)
        # Nothing that comes later is known yet.
        before = Covariance(variance[:37], processes, encoders[:37] if processes else None, STEP, PARTS[:1])
        np.testing.assert_allclose(before.log_density(x[:37, 0]), every[:37], rtol=1e-10)


def test_a_process_of_no_level_and_no_derivative_are_none():
    variance, _, x = some(4)
    found = Covariance(variance, [LaggedNoise(0.0, 1.0)], np.zeros(90), STEP, PARTS)
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
    own = Covariance(np.full(n, 0.25), [LaggedNoise(1.2, 0.1)], b, STEP, (slice(0, n),))
    assert r @ own.solve(r) / n == pytest.approx(1.0, abs=4 * np.sqrt(2 / n))
    white = Covariance(np.full(n, float(np.var(r))), [], None, STEP, (slice(0, n),))
    likelihood = [-0.5 * (r @ k.solve(r) + k.log_det) for k in (own, white)]
    assert likelihood[0] > likelihood[1] + 500


def test_a_smooth_process_is_white_noise_through_two_lags():
    """Drawn by a filter: variance, and the covariance a few samples on, are those of K."""
    n, time = 200_000, 0.1
    decay = np.exp(-STEP / time)
    drawn = np.asarray(lfilter([1.0], [1.0, -2 * decay, decay**2], np.random.default_rng(5).normal(size=n)))[1000:]
    drawn /= np.std(drawn)
    k = Covariance(np.full(90, 1e-6), [LaggedNoise(1.0, time, 2)], None, STEP, (slice(0, 90),)).dense()
    for lag in (1, 3, 8):
        assert k[40, 40 + lag] == pytest.approx(np.mean(drawn[lag:] * drawn[:-lag]), abs=0.02)
    assert k[40, 43] == pytest.approx((1 + 0.6) * np.exp(-0.6), rel=0.01)  # nearly (1 + d / τ) e^(-d / τ)
