"""Least squares above lower bounds, held against SciPy's bounded-variable least squares."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from snarelab.identification.checks import bounded
from snarelab.identification.checks.bounded import least_above


def case(seed: int, n: int):
    """Columns that go almost together, so that what is held decides what else must be."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(3 * n, n)) + 3.0 * rng.normal(size=(3 * n, 1))
    y = columns @ rng.normal(size=n) + rng.normal(size=3 * n)
    low = np.where(rng.random(n) < 0.6, rng.normal(size=n) - 0.3, -np.inf)
    return columns, y, low


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("guess", ["nothing", "what is below alone", "all"])
@pytest.mark.parametrize("tried", [0, bounded.TRIED])
def test_the_least_is_scipys(seed, guess, tried, monkeypatch):
    monkeypatch.setattr(bounded, "TRIED", tried)
    columns, y, low = case(seed, 25)
    matrix, right = columns.T @ columns, columns.T @ y
    start = {"nothing": low > np.inf, "what is below alone": np.linalg.solve(matrix, right) < low, "all": low < np.inf}
    b, held = least_above(matrix, right, low, start[guess])
    wanted = lsq_linear(columns, y, (low, np.inf), method="bvls", tol=1e-14)
    np.testing.assert_allclose(b, wanted.x, rtol=1e-7, atol=1e-9)
    assert 3 < held.sum() < np.isfinite(low).sum()
    np.testing.assert_array_equal(b[held], low[held])


def test_without_bounds_it_is_the_solution():
    columns, y, _ = case(0, 10)
    matrix, right = columns.T @ columns, columns.T @ y
    b, held = least_above(matrix, right, np.full(10, -np.inf), np.zeros(10, bool))
    np.testing.assert_allclose(b, np.linalg.solve(matrix, right), rtol=1e-9)
    assert not held.any()
