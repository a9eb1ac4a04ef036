"""Link encoders: how sure a name is against its rivals, and where effects that the model has already start from."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from snarelab.identification.fitting.experiment import Scales
from snarelab.identification.links import diagnose
from snarelab.identification.links.pair import Pair, PairFit
from snarelab.identification.links.search import Named, Searched, Trial, _weigh
from snarelab.identification.reliability import BOOTSTRAPS
from snarelab.models.effects import get_effect
from snarelab.models.model import Placed

WHITE = np.eye(3)
"""Residuals (3,): what one trial explains has nothing of what another does."""


def trial(number, gains, score):
    placed = Placed(get_effect("sensor_drift"), f"q_link.joint{number}")
    fit = PairFit((placed,), np.zeros(1), 1.0 - WHITE[number], np.zeros((3, 1)))
    return Trial(placed, fit, np.array(gains, float), 1.0, score, 0.5, True)


def plain():
    return PairFit((), np.zeros(0), np.ones(3), np.zeros((3, 0)))


def test_one_that_wins_every_bootstrap_is_short_of_certain_by_half_a_win():
    """Half a win more for each of two: (n + ½) and ½ of n + 1, for a rival that gains less on every block."""
    named = _weigh(trial(0, [9.0, 7.0, 8.0, 9.0], 32.0), [trial(1, [4.0, 3.0, 2.0, 5.0], 13.0)], plain(), 1)
    ((rival, probability, separable),) = named.rivals
    assert rival.at == "q_link.joint1"
    assert probability == pytest.approx(0.5 / (BOOTSTRAPS + 1), rel=1e-12)
    assert 1 - named.margin == pytest.approx(0.5 / (BOOTSTRAPS + 1), rel=1e-9)
    assert separable  # it never won, and what it explains is not alike


def test_two_that_gain_the_same_on_different_blocks_are_equally_likely():
    """The blocks' order is all that tells them apart, and a bootstrap draws every order as often."""
    gains = np.random.default_rng(4).exponential(10.0, 12)
    named = _weigh(trial(0, gains, gains.sum()), [trial(1, gains[::-1], gains.sum())], plain(), 2)
    ((_, probability, separable),) = named.rivals
    spread = 0.5 / np.sqrt(BOOTSTRAPS)
    assert named.margin == pytest.approx(0.5, abs=4 * spread)
    assert probability + named.margin == pytest.approx(1.0, rel=1e-12)
    assert not separable


def test_three_rivals_probabilities_add_up_to_one_and_stand_in_order():
    rng = np.random.default_rng(5)
    gains = [rng.normal(level, 4.0, 20) for level in (6.0, 4.0, 5.0)]
    best, *others = (trial(i, x, x.sum()) for i, x in enumerate(gains))
    named = _weigh(best, others, plain(), 3)
    odds = [odd for _, odd, _ in named.rivals]
    assert named.margin + sum(odds) == pytest.approx(1.0, rel=1e-12)
    assert odds == sorted(odds, reverse=True)
    assert all(odd > 0 for odd in odds)


@pytest.mark.parametrize(("score", "counted"), [(20.0, False), (20.1, True)])
def test_what_scores_a_fifth_of_the_best_is_no_rival(score, counted):
    named = _weigh(trial(0, [50.0, 50.0], 100.0), [trial(1, [5.0, 5.0], score)], plain(), 0)
    assert len(named.rivals) == counted
    assert named.margin == pytest.approx(1 - (0.5 / (BOOTSTRAPS + 1) if counted else 0))


def test_what_is_paid_for_parameters_counts_in_every_bootstrap():
    """Each block gains the same, 10 and 11 in all: the dearer by 2 never wins, the dearer by half a one always."""
    for price, margin in ((3.0, BOOTSTRAPS + 0.5), (1.5, 0.5)):
        rival = replace(trial(1, [5.5, 5.5], 9.0), price=price)
        named = _weigh(trial(0, [5.0, 5.0], 9.0), [rival], plain(), 0)
        assert named.margin == pytest.approx(margin / (BOOTSTRAPS + 1))


@pytest.mark.parametrize(("cosine", "separable"), [(0.97, True), (0.99, False), (-1.0, True)])
def test_what_explains_the_same_is_not_told_apart_though_it_never_wins(cosine, separable):
    """What each explains is its part of a residual of ones: along the first axis, and at this cosine to it."""
    other = np.array([cosine, np.sqrt(1 - cosine**2), 0.0])
    best, rival = trial(0, [9.0, 7.0], 16.0), trial(1, [4.0, 3.0], 7.0)
    rival = replace(rival, fit=replace(rival.fit, residual=1.0 - 3 * other))
    ((_, probability, told),) = _weigh(best, [rival], plain(), 1).rivals
    assert probability < 0.05
    assert told is separable


def test_an_effect_given_without_values_starts_at_its_usual_ones_in_the_joints_own_scale(monkeypatch):
    """Backlash: a spring of 300 and a damper of 0.1 times peak torque per travel, here 8 N·m over 0.5 rad."""

    class Begun(Exception):
        pass

    def begin(_pair, given, values, *_):
        raise Begun([p.key for p in given], values.tolist())

    monkeypatch.setattr(diagnose, "search_pair", begin)
    pair = Pair("joint1", "revolute", Scales(speed=2.0, travel=0.5, torque=8.0), ())
    effects = (Placed(get_effect("backlash"), "joint1"), Placed(get_effect("joint_elasticity"), "joint2"))
    given: Any = type("Given", (), {"effects": effects, "values": {"backlash.joint1.gap": 2e-3}})
    with pytest.raises(Begun) as begun:
        diagnose._diagnose(pair, pair, given, 1, 0)
    keys, values = begun.value.args
    assert keys == ["backlash.joint1"]
    assert values == pytest.approx([300 * 16.0, 0.1 * 16.0, 2e-3])  # stiffness, damping, and the gap that was given


def fit(*placed, energy):
    """Two zeros after the effects' values; a residual (4,) of this energy."""
    return PairFit(tuple(placed), np.zeros(len(placed) + 2), np.full(4, np.sqrt(energy / 4)), np.zeros((4, 2)))


def test_a_name_that_the_held_out_recording_does_not_confirm_is_barred_and_the_search_goes_on(monkeypatch):
    """Drift explains more where it is fitted, but less than a twentieth of the other; a gain a third of both."""
    drift, gain = (Placed(get_effect(name), "q_link.joint1") for name in ("sensor_drift", "sensor_gain"))
    trained, held = {(): 12.0, (drift,): 5.0, (gain,): 8.0}, {(): 12.0, (drift,): 11.6, (gain,): 8.0}
    searches, none = [], cast(Any, None)

    def search(_pair, placed, values, _n, rejected, _seed):
        searches.append((placed, tuple(rejected), len(values)))
        wanted = [p for p in (drift, gain) if p.key not in rejected and p not in placed][:1] if not placed else []
        tried = [Trial(p, fit(p, energy=trained[(p,)]), np.ones(2), 1.0, 9.0, 0.5, True) for p in wanted]
        named = tuple(Named(t, 0.9, ()) for t in tried)
        last = tried[-1].fit if tried else fit(*placed, energy=trained[placed])
        return Searched(named, fit(*placed, energy=trained[placed]), last, (), none, 1.0)

    monkeypatch.setattr(diagnose, "search_pair", search)
    monkeypatch.setattr(diagnose, "fit_pair", lambda _pair, placed, _theta: fit(*placed, energy=trained[placed]))
    monkeypatch.setattr(diagnose, "held_out", lambda _p, _l, found: fit(*found.placed, energy=held[found.placed]))
    monkeypatch.setattr(diagnose, "_nameless", lambda *_: 0.0)
    runs: Any = (None, None)
    pair = Pair("joint1", "revolute", Scales(speed=2.0, travel=0.5, torque=8.0), runs)
    given: Any = type("Given", (), {"effects": (), "values": {}})
    found = diagnose._diagnose(pair, pair, given, 1, 0)
    assert found.rejected == (drift,)
    assert [s.placed for s in found.steps] == [(), (gain,)]
    (proof,) = found.proofs
    assert (proof.without, proof.within) == pytest.approx((np.sqrt(3.0), np.sqrt(2.0)))
    assert searches == [((), (), 0), ((), (drift.key,), 0)]
