"""Limits of detection: of the smallest effect that would have been seen, and what it takes to be seen."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest

from snarelab.identification.search import screening
from snarelab.identification.search.evidence import Channel, Evidence
from snarelab.identification.search.grounds import NULLS
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

N, NOISE_REACHES, PRICE = 400, 7.0, 3.0
BASELINE, OTHERS = np.random.default_rng(8).normal(size=(2, N, 2))
COLUMN = OTHERS[:, 0] + BASELINE[:, 0]
"""Whitened, for an amplitude of one: the baseline can mimic about half of it."""


def gained(y):
    """Log-likelihood that the column gains beside the baseline, by two regressions."""
    left = [y - x @ np.linalg.lstsq(x, y, rcond=None)[0] for x in (BASELINE, np.column_stack([BASELINE, COLUMN]))]
    return 0.5 * float(left[0] @ left[0] - left[1] @ left[1])


def screened(monkeypatch, worth, residual):
    """A screening of one effect on one channel; its baseline, grid and judge are stand-ins."""
    block = np.arange(N) * 10 // N
    evidence = Evidence([Channel(np.arange(2), BASELINE, residual, OTHERS[:, 1], block)], 2, 10)
    placed = Placed(get_effect("viscous_friction"), "joint1")
    judged = Made(
        placed=placed,
        variant=Made(amplitudes=np.array([0])),
        score=1.0,
        price=PRICE,
        channels=(0,),
        columns={0: COLUMN[:, None]},
    )

    def tried(_ground, _options, null):
        null.enter((0,), np.full(NULLS, NOISE_REACHES))
        return Made(best=judged, asked=None)

    samples = Made(evidence=evidence)
    ground = Made(asked=samples, near_rest=samples, measured=samples, heard=np.zeros(1))
    for name, stand_in in {
        "readings": lambda *_: None,
        "library": lambda _: [placed],
        "variants": lambda *_: [],
        "grounds": lambda *_: ground,
        "tried": tried,
        "_worth": lambda *_: {placed.key: worth},
        "_nameless": lambda *_: {},
    }.items():
        monkeypatch.setattr(screening, name, stand_in)
    found: Any = Made(assembly=Made(unit=lambda *_: "N*m*s/rad"))
    model: Any = Made(joints=("joint1",))
    noise: Any = Made()
    (limit,) = screening.screen(model, found, [], [], noise, 0, lambda _: None).limits
    return limit


def test_an_effect_just_above_its_limit_beats_noise_after_its_price_and_one_just_below_does_not(monkeypatch):
    limit = screened(monkeypatch, 0.0, np.random.default_rng(9).normal(size=N))
    assert (limit.name, limit.at, limit.parameter) == ("viscous_friction", "joint1", "coefficient")
    beside = BASELINE @ [3.0, -2.0]  # the baseline is fitted again, whatever it was
    for factor, seen in ((1.02, True), (1.0 + 1e-9, True), (1.0 - 1e-9, False), (0.98, False)):
        score = gained(factor * limit.value * COLUMN + beside) - PRICE
        assert (score > NOISE_REACHES) is seen, factor


def test_an_effect_at_its_limit_explains_the_share_that_is_worth_a_name_where_that_takes_more(monkeypatch):
    residual = np.random.default_rng(9).normal(size=N, scale=2.0)
    limit = screened(monkeypatch, 0.2, residual)
    assert gained(limit.value * COLUMN) == pytest.approx(0.5 * 0.2 * np.sum(residual**2), rel=1e-9)
    assert gained(limit.value * COLUMN) > NOISE_REACHES + PRICE


@pytest.mark.parametrize(
    ("name", "given"),
    [("position_dependent_friction", ["cosine", "sine"]), ("harness_stiffness", ["stiffness"])],
)
def test_each_amplitude_has_a_limit_by_itself_but_for_what_is_no_effect_alone(name, given):
    block = np.arange(N) * 10 // N
    residual = np.random.default_rng(9).normal(size=N)
    evidence = Evidence([Channel(np.arange(2), BASELINE, residual, OTHERS[:, 1], block)], 2, 10)
    two = np.column_stack([COLUMN, 3.0 * OTHERS[:, 1]])
    judged: Any = Made(
        placed=Placed(get_effect(name), "joint1"),
        variant=Made(amplitudes=np.array([0, 1])),
        channels=(0,),
        columns={0: two},
    )
    assembly: Any = Made(unit=lambda *_: "N*m")
    limits = screening._limits(assembly, evidence, judged, 7.0, 0.0)
    assert [limit.parameter for limit in limits] == given
    for k, limit in enumerate(limits):
        alone = limit.value * two[:, [k]]
        left = alone - BASELINE @ np.linalg.lstsq(BASELINE, alone, rcond=None)[0]
        assert 0.5 * float(np.sum(left**2)) == pytest.approx(7.0, rel=1e-9)
