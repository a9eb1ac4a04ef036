"""The residual of which periods are found: divided by its covariance, with what stands beside it projected out."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.arms.periods import Periods


class Scaled:
    """Independent noise of one variance a sample."""

    def __init__(self, variance):
        self.variance = variance

    def solve(self, x):
        return x / self.variance[:, None]


def divided(rng, columns, weight):
    """S⁻¹ r by Periods, and r and the variances it is of."""
    r, variance = rng.normal(size=(40, 1)), rng.uniform(0.5, 2, 40)
    index = np.arange(columns.shape[1])
    others: Any = SimpleNamespace(parts=[[(index, columns)]])
    covariance: Any = Scaled(variance)
    along: Any = SimpleNamespace()
    return Periods(along, [r], [[covariance]], others, weight)._divided_of(0)[0], r[:, 0], variance


def test_what_stands_beside_is_projected_out():
    rng = np.random.default_rng(1)
    columns, weight = rng.normal(size=(40, 3)), np.array([1.0, 2.0, 0.5])
    found, r, variance = divided(rng, columns, weight)
    dense = np.diag(variance) + (columns * weight) @ (columns * weight).T
    assert found == pytest.approx(np.linalg.solve(dense, r), rel=1e-9, abs=1e-12)


def test_two_columns_alike_and_large_are_projected_out_as_one():
    rng = np.random.default_rng(2)
    x = rng.normal(size=(40, 1))
    found, r, variance = divided(rng, 1e10 * np.hstack([x, x]), np.ones(2))
    one = r - x[:, 0] * (x[:, 0] @ (r / variance)) / (x[:, 0] @ (x[:, 0] / variance))
    assert found == pytest.approx(one / variance, rel=1e-6, abs=1e-6)
