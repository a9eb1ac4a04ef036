"""What nothing explains while balls touch, on numbers made by hand."""

import numpy as np
import pytest

from snarelab.identification.docking.noise import _touches, _unexplained

RNG = np.random.default_rng(0)
TOUCH = np.repeat([0, 1, 2, 3], 6)


def test_a_touch_is_a_run_of_windows_of_one_recording():
    rows = [np.array([1, 1, 0, 1, 0, 1], bool), np.array([1, 0, 0, 1, 1], bool)]
    assert _touches(rows).tolist() == [1, 1, 2, 3, 4, 5, 5]


def test_what_every_touch_has_is_explained():
    columns = RNG.normal(size=(24, 2))
    assert np.abs(_unexplained(columns @ [1.0, -2.0], columns, TOUCH)).max() < 1e-9


def test_what_one_touch_has_alone_is_noise_though_a_column_follows_it():
    """Plain least squares would leave nothing of it."""
    alone = np.where(TOUCH == 2, RNG.normal(size=24), 0.0)
    columns = np.stack([alone, RNG.normal(size=24)], axis=1)
    assert _unexplained(alone, columns, TOUCH) == pytest.approx(alone)


def test_a_column_that_would_make_it_worse_is_left_out():
    """Touches that contradict each other say nothing of a third."""
    column = RNG.normal(size=24)
    left = np.where(TOUCH % 2 == 0, column, -column)
    assert np.all(np.abs(_unexplained(left, column[:, None], TOUCH)) <= np.abs(left) + 1e-12)


def test_a_single_touch_is_all_noise():
    left = RNG.normal(size=6)
    assert np.array_equal(_unexplained(left, RNG.normal(size=(6, 2)), np.zeros(6, int)), left)
