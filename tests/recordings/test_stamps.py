"""When samples were taken: told from positions whose noise is an encoder's steps."""

import numpy as np
import pytest

from snarelab.recordings.stamps import taken
from snarelab.recordings.uniform_clock import uniform

PERIOD = 0.004


def swing(t):
    return np.stack([0.8 * np.sin(1.3 * t), 0.5 * np.sin(2.9 * t + 1.0), np.full_like(t, 0.3)], 1)


def counted(t, bits=19):
    step = 2 * np.pi / 2**bits
    return step * np.round(swing(t) / step)


@pytest.mark.parametrize("jitter", [0.005, 0.02, 0.08])
def test_jitter_of_stamps_is_taken_out(jitter):
    rng, t = np.random.default_rng(1), PERIOD * np.arange(3000)
    when, found = taken(t + jitter * PERIOD * rng.standard_normal(len(t)), counted(t), PERIOD)
    assert found == pytest.approx(jitter, rel=0.05)
    assert np.std(when - t) < 0.2 * jitter * PERIOD


@pytest.mark.parametrize("jitter", [0.005, 0.02, 0.08])
def test_samples_that_were_taken_unevenly_keep_their_stamps(jitter):
    rng = np.random.default_rng(2)
    t = PERIOD * (np.arange(3000) + jitter * rng.standard_normal(3000))
    when, found = taken(t, counted(t), PERIOD)
    assert found == 0.0
    np.testing.assert_array_equal(when, t)


def test_lost_rows_and_a_clock_that_drifts_are_kept():
    """Every fiftieth row is lost, and the logger's clock gains two samples in three thousand, faster and slower."""
    rng, t = np.random.default_rng(3), PERIOD * np.arange(3000)
    t = t[np.arange(len(t)) % 50 != 7]
    drifts = t + 2 * PERIOD * np.sin(2 * np.pi * t / t[-1])
    when, found = taken(drifts + 0.02 * PERIOD * rng.standard_normal(len(t)), counted(t), PERIOD)
    assert found == pytest.approx(0.02, rel=0.05)
    assert np.max(np.abs(when - drifts)) < 0.03 * PERIOD


def test_where_nothing_moves_stamps_are_kept():
    rng, t = np.random.default_rng(4), PERIOD * np.arange(500)
    stamps = t + 0.02 * PERIOD * rng.standard_normal(len(t))
    when, found = taken(stamps, np.zeros((500, 2)), PERIOD)
    assert found == 0.0
    np.testing.assert_array_equal(when, stamps)


@pytest.mark.parametrize(("jitter", "believed"), [(7e-4, True), (1.5e-3, False)])
def test_what_rounding_makes_of_stamps_is_no_jitter(jitter, believed):
    rng, t = np.random.default_rng(5), PERIOD * np.arange(3000)
    stamps = t + jitter * PERIOD * rng.standard_normal(len(t))
    when, _ = taken(stamps, counted(t, bits=26), PERIOD)
    assert np.array_equal(when, stamps) == believed


@pytest.mark.parametrize("jitter", [0.005, 0.02])
def test_a_recording_whose_stamps_jitter_is_not_interpolated(jitter):
    """Position and torque are those that were logged, at a clock that is even to a hundredth of a period."""
    rng, t = np.random.default_rng(6), PERIOD * np.arange(3000)
    q = counted(t)
    ((when, kept, torque, *_),), notes, _, _ = uniform(
        t + jitter * PERIOD * rng.standard_normal(len(t)), q, 2 * q, np.full(q.shape, np.nan)
    )
    np.testing.assert_array_equal(kept, q)
    np.testing.assert_array_equal(torque, 2 * q)
    assert np.max(np.abs(np.diff(when) - PERIOD)) < 0.01 * PERIOD
    assert any("jitter" in note for note in notes)
