"""What stands beside every explanation, halved and doubled: an answer that stands at it must change."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from explained import Explained
from moved_numbers import FACTORS, about, move, planted, smallest

from snarelab.identification.arms import nuisance_columns
from snarelab.identification.arms.beside import curves
from snarelab.identification.evidence import tolerant
from snarelab.identification.evidence.evidence import ResidualChannel
from snarelab.identification.evidence.pool import Hypothesis
from snarelab.identification.evidence.weighed import NuisanceColumns
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


def spread(monkeypatch, theta=2.0, shape=False) -> float:
    """Prior deviation of a parameter that makes a tenth of its channel's torque a unit."""
    found: Any = SimpleNamespace(theta=np.array([theta]), assembly=None)
    monkeypatch.setattr(nuisance_columns, "shapes", lambda _: np.array([shape]))
    baseline = [[(np.zeros(1, int), np.ones((5, 1)))]]
    return float(nuisance_columns._spread(found, baseline, np.array([10.0]))[0])


def test_how_far_the_baseline_may_move(monkeypatch):
    """Half of its own 2, and 0.2 of the channel's torque, which is 2; a shape by 0.3 of itself at most."""
    assert spread(monkeypatch) == pytest.approx(1 + 2)
    assert spread(monkeypatch, shape=True) == pytest.approx(0.6)
    moved = {"BASELINE": (2.0, 5.0), "BASELINE_OWN": (2.5, 4.0)}
    for constant, wanted in moved.items():
        for factor, value in zip(FACTORS, wanted, strict=True):
            with monkeypatch.context() as patch:
                move(patch, constant, factor)
                assert spread(patch) == pytest.approx(value)
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "BASELINE_SHAPE", factor)
            assert spread(patch, shape=True) == pytest.approx(0.6 * factor)


def small(own_share: float) -> dict[tuple[int, str], float]:
    """Sizes of the small curves beside a friction law that makes this share of the channel's torque."""
    placed = PlacedEffect(get_effect("viscous_friction"), "joint1")
    assembly: Any = SimpleNamespace(
        placed=(placed,), index_of=lambda _: [0], joint_of=lambda _: 0, slots=[
            SimpleNamespace(effect="viscous_friction", at="joint1", name="coefficient")])  # fmt: skip
    found: Any = SimpleNamespace(theta=np.array([own_share]), assembly=assembly)
    return curves._sizes(found, [[(np.zeros(1, int), 10 * np.ones((5, 1)))]], np.array([10.0]))


def test_small_curves_stand_beside_everything(monkeypatch):
    """A share of the torque; and one of a law's share over what it runs over, here speed, both squared and added."""
    everywhere, of_law = 0.001, 0.4 * 0.02
    sizes = small(0.4)
    assert sizes[0, "position"] == pytest.approx(everywhere)
    assert sizes[0, "speed by direction"] == pytest.approx(np.hypot(everywhere, of_law))
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "DISCREPANCY", factor)
            assert small(0.4)[0, "position"] == pytest.approx(factor * everywhere)
        with monkeypatch.context() as patch:
            move(patch, "LAW_ERROR", factor)
            assert small(0.4)[0, "speed by direction"] == pytest.approx(np.hypot(everywhere, factor * of_law))


def test_a_payload_is_named_beyond_what_masses_are_known_to(monkeypatch):
    """Smaller ones are the masses' tolerance: the smallest that is named goes with how wide that may be."""

    def named(size):
        made = planted(1.0)
        _, x = made.columns.of(0, 0)
        x *= 1000
        own = made.pieces[0][0]
        made.pieces[0][0] = ResidualChannel(
            size * x[:, 0].astype(float), own.covariance, np.zeros(1, int), x[:, :1].astype(float)
        )
        made = Explained(made.pieces, made.columns, made.items[:1], 1)
        payload = Hypothesis("payload", True, (made.items[0],), -6.0)
        masses = NuisanceColumns([], 1, slice(0, 1), [], np.ones(1))
        weighed: Any = SimpleNamespace(beside=masses, evidence=made.evidence(), pool=(payload,), noises=())
        return bool(tolerant.searched(weighed, (0,), (), range(len(weighed.noises)))[2])

    before = smallest(named)
    assert before > 0.03
    less, as_it_is, more = about(monkeypatch, "TOLERANCES", (0.001, 0.003, 0.01, 0.03), lambda: smallest(named))
    assert less < as_it_is < more
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "TOLERANCES", factor)
            assert smallest(named) == pytest.approx(factor * before, rel=0.25)
