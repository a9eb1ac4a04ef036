"""What waits until larger laws are fitted, and what is too small beside their own error to be told."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from explained import Explained, white

from snarelab.identification.arms import hypotheses
from snarelab.identification.decision.search import _taken_out
from snarelab.identification.evidence.evidence import ResidualChannel
from snarelab.identification.evidence.pool import CandidateColumns


def weighed(n_train: int) -> tuple[Any, int]:
    """One channel of unit white noise in two recordings."""
    made = white(np.random.default_rng(0), 1, {})
    own = made.pieces[0][0]
    piece, n = ResidualChannel(own.residual, own.covariance, own.index, own.columns), len(own.residual)
    columns = CandidateColumns([n, n])
    columns.add({0: [np.ones((n, 1))] * 2})
    evidence = Explained([[piece], [piece]], columns, made.items, 0).evidence()
    return Made(evidence=evidence, n_train=n_train, noises=(None,)), n


@pytest.mark.parametrize("n_train", [1, 2])
def test_laws_took_half_the_energy_that_they_took_out_in_units_of_the_noise(n_train):
    made, n = weighed(n_train)
    kind: Any = Made(residuals=lambda left: [np.full((n, 1), left)] * n_train)
    assert _taken_out(kind, 3.0, 1.0, made) == pytest.approx(0.5 * (9 - 1) * n * n_train)
    assert _taken_out(kind, 1.0, 3.0, made) == pytest.approx(0.0)  # a fit that leaves more took nothing


def test_a_late_law_is_told_by_its_derivatives():
    """A sine that comes 0.05 s late is itself, less 0.05 s of its first derivative, and half the square of its second;
    over a gap nothing is differentiated."""
    step, n = 0.02, 600
    t = step * np.arange(n)
    motion = Made(band_segments=lambda: [slice(0, 300), slice(300, 600)])
    along: Any = Made(instruments=[Made(motion=motion)], n_train=1, scale=np.array([2.0, 1.0]))
    law = np.sin(2 * t)[:, None]
    columns = CandidateColumns([n])
    item = hypotheses.lagging(along, {1: [law]}, columns)
    own = columns.some(0, 1, item.index)
    inside = np.r_[2:298, 302:598]
    late = law[:, 0] - 0.05 / step * own[:, 0] + 0.5 * (0.05 / step) ** 2 * own[:, 1]
    np.testing.assert_allclose(late[inside], np.sin(2 * (t - 0.05))[inside], atol=4e-4)
    np.testing.assert_allclose(np.sqrt(np.mean((own * item.spread) ** 2, axis=0)), 1.0)  # of the channel's torque
