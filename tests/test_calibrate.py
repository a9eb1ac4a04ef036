"""The reliability curve: fitted without falling, and read without certainty."""

import numpy as np
import pytest

from proof.calibrate import curve
from snarelab.identification.reliability import probability


def least_squares_by_hand(values, weights):
    """Isotonic fit by its min-max formula (Barlow et al. 1972): no pooling at all."""
    n = len(values)
    mean = [
        [np.average(values[a : b + 1], weights=weights[a : b + 1]) if b >= a else 0.0 for b in range(n)]
        for a in range(n)
    ]
    return [max(min(mean[a][b] for b in range(k, n)) for a in range(k + 1)) for k in range(n)]


@pytest.mark.parametrize("seed", range(5))
def test_curve_is_the_isotonic_fit_of_smoothed_frequencies(seed):
    rng = np.random.default_rng(seed)
    margin = np.repeat(rng.random(12), 10)
    right = rng.random(120) < 0.3 + 0.5 * margin
    shuffled = rng.permutation(120)
    knots, found = curve(margin[shuffled], right[shuffled], group=10)
    groups = np.unique(margin)
    assert knots == pytest.approx(groups)
    frequency = [(right[margin == m].sum() + 1) / 12 for m in groups]
    assert found == pytest.approx(least_squares_by_hand(frequency, np.full(12, 12.0)))


def test_equal_margins_share_a_knot_and_small_groups_join():
    knots, found = curve([0.2, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.4], [0, 1, 1, 1, 1, 1, 0, 1], group=3)
    assert knots == pytest.approx([1.1 / 3, 1.0])
    assert found == pytest.approx([2 / 5, 6 / 7])


def test_nothing_wrong_in_a_bank_is_not_certainty():
    _, found = curve(np.ones(8), np.ones(8))
    assert found == pytest.approx([0.9])


def test_stored_curve_never_falls_and_is_never_certain():
    found = np.array([probability(m) for m in np.linspace(0.0, 1.0, 501)])
    assert np.all(np.diff(found) >= 0)
    assert found[0] > 0
    assert found[-1] < 1
    assert found[-1] > 0.5  # the package's names are worth more than a coin
