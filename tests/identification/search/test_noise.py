"""The noise model, against processes whose spectrum and innovations are known."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.signal

from snarelab.identification.search.noise import LONGEST, whitener

N = 6000
WHOLE = [slice(0, N)]
NOTHING = np.zeros((N, 0))


def process(coefficients, sigma=1.0, n=N, seed=0):
    """x[n] = a1 x[n-1] + a2 x[n-2] + ... + sigma * innovation, settled."""
    e = sigma * np.random.default_rng(seed).normal(size=n + 500)
    return np.asarray(scipy.signal.lfilter([1.0], np.r_[1.0, -np.asarray(coefficients)], e))[500:]


def spectrum(coefficients, sigma, frequency):
    """Density of an autoregression over frequency in cycles a sample."""
    turns = np.exp(-2j * np.pi * np.outer(frequency, np.arange(1, len(coefficients) + 1)))
    return sigma**2 / np.abs(1 - turns @ np.asarray(coefficients)) ** 2


def poles(radius, angle):
    """Coefficients of the AR(2) with poles radius * exp(±i angle)."""
    return [2 * radius * np.cos(angle), -(radius**2)]


@pytest.mark.parametrize("coefficients", [poles(0.9, 0.4), poles(0.7, 1.8), [1.2, -0.3]])
@pytest.mark.parametrize("sigma", [1.0, 3e-3])
def test_an_autoregression_is_recovered(coefficients, sigma):
    found, innovations = whitener(process(coefficients, sigma), NOTHING, WHOLE)
    frequency = np.linspace(0.005, 0.495, 99)
    ratio = spectrum(found.coefficients, found.sigma, frequency) / spectrum(coefficients, sigma, frequency)
    assert np.max(np.abs(np.log(ratio))) < 0.25
    assert found.sigma == pytest.approx(sigma, rel=0.03)
    assert np.std(innovations) == pytest.approx(1.0, rel=0.03)
    # White: no autocorrelation beyond what chance gives 20 lags.
    x = innovations - innovations.mean()
    correlation = [x[k:] @ x[:-k] / (x @ x) for k in range(1, 21)]
    assert np.max(np.abs(correlation)) < 4 / np.sqrt(len(x))


def test_white_noise_needs_no_filter():
    found, innovations = whitener(process([], 2.0), NOTHING, WHOLE)
    assert len(found.coefficients) <= 1
    assert found.sigma == pytest.approx(2.0, rel=0.03)
    assert len(innovations) == N - LONGEST


def test_whitening_keeps_a_regression_what_it_is():
    """Generalised least squares (Aitken 1936): the whitened slope is right, its standard error honest."""
    coefficients, slopes, errors = poles(0.95, 0.2), [], []
    for seed in range(40):
        column = process([0.9], seed=100 + seed, n=1500)
        y = 0.2 * column + process(coefficients, seed=seed, n=1500)
        found, _ = whitener(y, column[:, None], [slice(0, 1500)])
        a, b = found(column, [slice(0, 1500)]), found(y, [slice(0, 1500)])
        slopes.append(a @ b / (a @ a))
        errors.append(1 / np.sqrt(a @ a))
    assert np.mean(slopes) == pytest.approx(0.2, abs=4 * np.mean(errors) / np.sqrt(40))
    assert np.std(slopes) == pytest.approx(np.mean(errors), rel=0.35)


def test_an_effect_among_the_columns_is_not_learnt_as_noise():
    coefficients = poles(0.6, 1.2)
    noise, t = process(coefficients), np.arange(N)
    effect = np.sign(np.sin(2 * np.pi * t / 400))  # friction: strong, slow, and forty times the noise's power
    residual = 6.0 * effect + noise
    frequency = np.linspace(0.005, 0.495, 99)
    true = spectrum(coefficients, 1.0, frequency)
    saturated, _ = whitener(residual, np.stack([effect, np.sin(t / 70)], 1), WHOLE)
    assert np.max(np.abs(np.log(spectrum(saturated.coefficients, saturated.sigma, frequency) / true))) < 0.3
    learnt, _ = whitener(residual, NOTHING, WHOLE)
    assert np.log(spectrum(learnt.coefficients, learnt.sigma, frequency) / true)[0] > 2.0
    # What that would cost: the evidence for the effect, which is its energy once whitened.
    kept, lost = (np.sum(w(effect, WHOLE) ** 2) for w in (saturated, learnt))
    assert lost < 0.3 * kept


def test_columns_cost_degrees_of_freedom():
    rng = np.random.default_rng(1)
    noise, columns = rng.normal(size=1000), rng.normal(size=(1000, 400))
    found, _ = whitener(noise, columns, [slice(0, 1000)])
    assert found.sigma == pytest.approx(1.0, rel=0.1)


def test_columns_of_any_size_and_empty_ones():
    rng = np.random.default_rng(2)
    noise, column = process(poles(0.8, 0.5)), rng.normal(size=N)
    wanted, _ = whitener(noise + column, column[:, None], WHOLE)
    for scale in (1e-9, 1e9):
        found, _ = whitener(noise + column, np.stack([scale * column, 0 * column], 1), WHOLE)
        np.testing.assert_allclose(found.coefficients, wanted.coefficients, rtol=1e-6)
        assert found.sigma == pytest.approx(wanted.sigma, rel=1e-3)


def test_nothing_is_filtered_across_a_gap():
    coefficients = poles(0.9, 0.4)
    pieces = [slice(0, 2000), slice(2000, 2030), slice(2030, N)]
    x = np.concatenate([process(coefficients, seed=k, n=s.stop - s.start) + 50.0 * k for k, s in enumerate(pieces)])
    level = np.concatenate([np.full(s.stop - s.start, 50.0 * k) for k, s in enumerate(pieces)])
    found, innovations = whitener(x, np.eye(3)[(level / 50).astype(int)], pieces)
    assert len(innovations) == N - 3 * LONGEST
    whitened = found(level, pieces)
    # A level within each run stays a level: a step across a gap would stand out.
    for k, s in enumerate((slice(0, 1988), slice(1988, 2006), slice(2006, N - 36))):
        assert np.ptp(whitened[s]) < 1e-9 * (1 + 50 * k)
    assert found.sigma == pytest.approx(1.0, rel=0.05)


def test_columns_are_filtered_like_signals():
    found, _ = whitener(process(poles(0.9, 0.4)), NOTHING, WHOLE)
    x = np.random.default_rng(3).normal(size=(N, 3))
    together = found(x, WHOLE)
    np.testing.assert_allclose(together @ [1.0, 2.0, -1.0], found(x @ [1.0, 2.0, -1.0], WHOLE), atol=1e-9)
    np.testing.assert_array_equal(together[:, 1], found(x[:, 1], WHOLE))
    assert found(NOTHING, WHOLE).shape == (N - LONGEST, 0)


@pytest.mark.parametrize("length", [40, 20])
def test_a_recording_of_short_runs_still_has_a_noise_model(length):
    pieces = [slice(k, k + length) for k in range(0, 1200, length)]
    x = np.concatenate([process([0.7], seed=k, n=length) for k in range(len(pieces))])
    found, innovations = whitener(x, np.zeros((1200, 0)), pieces)
    assert found.sigma == pytest.approx(1.0, rel=0.15)
    assert len(innovations) == len(pieces) * (length - LONGEST)


def autoregression(x, order, keep):
    """Coefficients and mean square left of the samples in ``keep`` by those before them, by least squares."""
    past = np.stack([x[keep - k - 1] for k in range(order)], 1) if order else np.zeros((len(keep), 0))
    a = np.linalg.lstsq(past, x[keep], rcond=None)[0]
    return a, np.mean((x[keep] - past @ a) ** 2)


@pytest.mark.parametrize(
    ("longest", "from_all"), [(4 * LONGEST + 1, False), (4 * LONGEST, True)], ids=["one long run", "short ones alone"]
)
@pytest.mark.parametrize("last", [True, False])
def test_short_runs_are_learnt_from_only_where_there_is_no_long_one(longest, from_all, last):
    """Runs up to four memories long count as short, wherever in the recording they stand; each gives up its head."""
    sizes = [30, longest, LONGEST, 40][:: 1 if last else -1]
    edges = np.cumsum([0, *sizes])
    segments = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    x = process([0.9], n=int(edges[-1]), seed=3)
    found, _ = whitener(x, np.zeros((len(x), 0)), segments)
    counted = [s for s in segments if (s.stop - s.start > LONGEST if from_all else s.stop - s.start == longest)]
    keep = np.concatenate([np.arange(s.start + LONGEST, s.stop) for s in counted])
    a, variance = autoregression(x, len(found.coefficients), keep)
    assert len(a) > 0
    np.testing.assert_allclose(found.coefficients, a, rtol=1e-9)
    assert found.sigma == pytest.approx(np.sqrt(variance), rel=1e-9)


@pytest.mark.parametrize(("n_columns", "freedom"), [(100, 300), (350, 100)])
def test_the_innovations_variance_is_per_degree_of_freedom_left_but_no_fewer_than_a_quarter(n_columns, freedom):
    """Of 400 samples; a column of zeros takes no freedom. Coefficients tell the order, so that the rest follows."""
    rng = np.random.default_rng(5)
    columns = np.linalg.qr(rng.normal(size=(400, n_columns)))[0]
    columns = np.column_stack([columns, np.zeros(400)])
    y = rng.normal(size=400)
    found, _ = whitener(y, columns, [slice(0, 400)])
    # The ridge holds each unit amplitude by 1e-3 of what 400 samples say.
    inner = columns[:, :-1] * np.sqrt(400)
    noise = y - inner @ np.linalg.solve(inner.T @ inner + 1e-6 * 400 * np.eye(n_columns), inner.T @ y)
    _, variance = autoregression(noise, len(found.coefficients), np.arange(LONGEST, 400))
    assert found.sigma == pytest.approx(np.sqrt(variance * 400 / freedom), rel=1e-6)


@pytest.mark.parametrize(("share", "all_count"), [(0.5, False), (0.51, True)])
def test_where_more_than_half_is_missing_all_counts(share, all_count):
    """White noise of unit size, and of ten in the first samples, which are missing."""
    n = 4000
    missing = np.arange(n) < share * n
    x = process([], n=n, seed=8) * np.where(missing, 10.0, 1.0)
    found, _ = whitener(x, np.zeros((n, 0)), [slice(0, n)], missing)
    assert found.sigma == pytest.approx(np.sqrt(share * 100 + 1 - share) if all_count else 1.0, rel=0.05)


def test_where_no_run_is_as_long_as_the_memory_all_counts():
    """Every sixth sample missing: no noise model could be learnt from runs of five."""
    x = process([0.8], seed=5)
    found, innovations = whitener(x, NOTHING, WHOLE, np.arange(N) % 6 == 0)
    whole, wanted = whitener(x, NOTHING, WHOLE)
    np.testing.assert_array_equal(found.coefficients, whole.coefficients)
    np.testing.assert_array_equal(innovations, wanted)
