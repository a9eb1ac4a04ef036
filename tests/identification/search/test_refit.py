"""A fit with more, or with less, starts from everywhere only where it ended in a bad optimum."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import refit


@pytest.fixture
def fits(monkeypatch):
    """Called with what channels leave, in units of the special case's; tells which fits start from everywhere."""

    def made(*left: float) -> list[bool]:
        started: list[bool] = []

        def fit(assembly, samples, *, start, multi_start, seed=0):
            started.append(multi_start)
            return SimpleNamespace(assembly=assembly, theta=np.array(left))

        monkeypatch.setattr(refit, "fit", fit)
        monkeypatch.setattr(refit, "carry", lambda before, assembly: before.theta)
        monkeypatch.setattr(refit, "fitted", lambda assembly, experiments: experiments)
        monkeypatch.setattr(refit, "channel_rms", lambda assembly, samples, theta: (np.asarray(theta), None))
        return started

    return made


NONE: Any = None
CASE: Any = SimpleNamespace(assembly=SimpleNamespace(keep=lambda *_: None, placed=()), theta=np.ones(2))


@pytest.mark.parametrize(
    ("left", "started"),
    [
        ((1.0, 1.0), [False]),
        ((1.06, 0.5), [False]),  # one channel for the other: the product of the likelihoods grew
        ((1.04, 1.0), [False]),
        ((1.06, 1.0), [False, True]),
        ((1.03, 1.03), [False, True]),
        ((np.nan, 0.5), [False, True]),
    ],
)
def test_a_bad_optimum_is_known_by_all_channels_together(fits, left, started):
    """The likelihood of channels whose noise is estimated is the product of what they leave."""
    seen = fits(*left)
    refit.refitted(CASE, NONE, [], False, 0)
    assert seen == started
    seen = fits(*left)
    refit.without(CASE, ["one"], [], CASE)
    assert seen == started


def test_what_rings_starts_from_everywhere_at_once(fits):
    seen = fits(1.0, 1.0)
    refit.refitted(CASE, NONE, [], True, 0)
    assert seen == [True]
