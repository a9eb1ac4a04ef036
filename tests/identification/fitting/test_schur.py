"""The Schur complement is least squares with the first unknowns free, whatever the scale of their columns."""

import numpy as np
import pytest

from snarelab.identification.fitting.schur import schur


@pytest.mark.parametrize("alike", [False, True], ids=["apart", "alike"])
def test_it_is_what_projection_leaves(alike):
    rng = np.random.default_rng(1)
    free = rng.normal(size=(200, 4)) * [1e-6, 1.0, 1e4, 1e9]
    if alike:
        free = np.hstack([free, free[:, :2] @ [[1.0], [2e-6]], np.zeros((200, 1))])
    last, y = rng.normal(size=(200, 3)) + free[:, 1:2], rng.normal(size=200)
    every = np.hstack([free, last])
    basis = np.linalg.qr(free[:, :4])[0]
    project = np.eye(200) - basis @ basis.T
    curvature, score = schur(every.T @ every, every.T @ y, free.shape[1])
    assert curvature == pytest.approx(last.T @ project @ last, rel=1e-6, abs=1e-6)
    assert score == pytest.approx(last.T @ project @ y, rel=1e-6, abs=1e-6)


def test_it_has_no_negative_curvature_where_nothing_is_left():
    free = np.random.default_rng(2).normal(size=(50, 3)) * [1.0, 1e5, 1e7]
    every = np.hstack([free, free @ np.ones((3, 2))])
    curvature, _ = schur(every.T @ every, every.T @ free[:, 0], 3)
    assert np.linalg.eigvalsh(curvature).min() >= -1e-12 * np.abs(curvature).max(initial=1.0)
