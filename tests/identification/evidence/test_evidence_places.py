"""Prior odds of places: they add up, and rise where the effect is at other joints already."""

from math import comb
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from explained import white

from snarelab.identification.arms import hypotheses as module
from snarelab.identification.evidence.pool import Hypothesis
from snarelab.identification.evidence.prior import log_share_of_places, pool
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect


@pytest.mark.parametrize("n", [1, 2, 5, 7])
def test_shares_of_all_sets_of_places_add_up_to_one(n):
    assert sum(comb(n, k) * np.exp(log_share_of_places(k, n)) for k in range(1, n + 1)) == pytest.approx(1.0)


def hypotheses(name: str, places, there=()) -> list[Hypothesis]:
    made = white(np.random.default_rng(0), len(places), {})
    placed = [PlacedEffect(get_effect(name), p) for p in places]
    named = {p.key: (p, [x]) for p, x in zip(placed, made.items, strict=True)}
    return pool(named, {}, [PlacedEffect(get_effect(name), p) for p in there])


def test_the_next_joint_is_likelier_the_more_joints_have_it():
    """Of three: one has it by 1/3 (½ + ½ · ⅓); the next then by a quarter, and the last by three to one."""
    (first, *_) = hypotheses("coulomb_friction", ("joint1", "joint2", "joint3"))
    odds = np.exp([first.prior_beside(k) for k in (0, 1, 2)])
    np.testing.assert_allclose(odds, [0.5 * (1 / 6 + 1 / 18), 0.25, 3.0])
    assert first.prior_beside(9) == first.prior_beside(2)  # more than all of them there are not


def test_what_the_model_has_counts():
    (last,) = hypotheses("coulomb_friction", ("joint3",), there=("joint1", "joint2"))
    assert np.exp(last.prior) == pytest.approx(3.0)
    (other,) = hypotheses("viscous_friction", ("joint3",))
    assert np.exp(other.prior) == pytest.approx(0.5)


def test_joints_that_no_model_couples_are_as_likely_as_an_effect_of_its_own():
    """At joints ½ of the names' odds, however many pairs of joints could be coupled; the other half is the pairs'."""
    places = ("joint1", "joint2", "joint1+joint2", "joint1-joint2", "joint2+joint3", "joint2-joint3")
    made = white(np.random.default_rng(0), len(places), {})
    placed = [PlacedEffect(get_effect("coulomb_friction"), p) for p in places]
    named = {p.key: (p, [x]) for p, x in zip(placed, made.items, strict=True)}
    several, alone = pool(named, {}, (), set(places[2:])), pool({k: named[k] for k in list(named)[:2]}, {}, ())
    np.testing.assert_allclose(np.exp([h.prior for h in several[:2]]), np.exp([h.prior for h in alone]) / 2)
    np.testing.assert_allclose(np.exp([h.prior for h in several[2:]]), 0.25 * np.exp(log_share_of_places(1, 4)))
    assert several[0].kind != several[2].kind


def test_a_sensors_fault_is_an_accident_of_one_place():
    several = hypotheses("sensor_bias", ("tau.joint1", "tau.joint2"), there=("tau.joint3",))
    assert [np.exp(h.prior_beside(k)) for h in several for k in (0, 1)] == pytest.approx([0.5 / 3] * 4)


def test_a_whole_law_has_its_parts_amplitudes(monkeypatch):
    """Beside Makkar friction a second Stribeck peak may be missing; Coulomb and viscous friction are in it already."""
    laws = ("viscous_friction", "coulomb_friction", "stribeck_friction", "makkar_friction")

    def offered(*given: str) -> set[str]:
        every = [PlacedEffect(get_effect(x), at) for x in laws for at in ("joint1", "joint2")]
        effects = [PlacedEffect(get_effect(x), "joint1") for x in given]
        monkeypatch.setattr(module, "library", lambda _: [p for p in every if p.key not in {x.key for x in effects}])
        monkeypatch.setattr(module, "_items", lambda *_: ["columns"])
        along: Any = SimpleNamespace(model=SimpleNamespace(effects=effects))
        columns: Any = None
        return {key.split("_")[0] for key in module.names(along, {}, columns) if key.endswith("joint1")}

    assert offered() == {"viscous", "coulomb", "stribeck", "makkar"}
    assert offered("makkar_friction") == {"stribeck"}
    assert offered("coulomb_friction") == {"viscous", "stribeck"}
