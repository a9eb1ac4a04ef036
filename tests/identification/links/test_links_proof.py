"""Which encoders are compared, what the held-out recording confirms, and what stands beside the names."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, named, pair, placed, run

from snarelab.identification.links import diagnose
from snarelab.identification.links.diagnose import Offset, diagnose_links
from snarelab.identification.links.pair import PairFit
from snarelab.identification.links.search import Searched, smooth

NONE = cast(Any, None)
GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")
DELAY, SPRING = placed("sensor_delay", "q_link.joint1"), placed("joint_elasticity", "joint1")


def fit(*effects, zeros=(0.0,), energy=4.0, n=4):
    """Values of the effects 1, 2, ... then zeros; a residual of this energy."""
    count = sum(len(p.effect.parameters) for p in effects)
    theta = np.r_[np.arange(1.0, count + 1), zeros]
    return PairFit(effects, theta, np.full(n, np.sqrt(energy / n)), np.zeros((n, len(theta))))


@pytest.mark.parametrize(
    ("zeros", "residual", "held", "there", "wanted"),
    [
        # Held out: of variance 1 and zeros 4 and 6, root of 1 + 26 without; of 1 + 1 with 5.
        ((4.0, 6.0), 0.1, 4.0, (4.0, 6.0), Offset(5.0, 1.0, np.sqrt(27), np.sqrt(2))),
        ((4.0, 6.0), 2.0, 4.0, (4.0, 6.0), Offset(5.0, np.sqrt(2), np.sqrt(27), np.sqrt(2))),  # noise above spread
        ((-5.0,), 0.5, 4.0, (-5.0,), Offset(-5.0, 0.5, np.sqrt(26), 1.0)),
        # Three deviations at least: spread of 3 and 7 is 2√2, of their mean 2; here 2.5.
        ((3.0, 7.0), 0.1, 4.0, (5.0,), None),
        ((0.301,), 0.1, 0.01, (0.301,), Offset(0.301, 0.1, np.sqrt(0.0025 + 0.301**2), 0.05)),
        ((0.299,), 0.1, 0.01, (0.299,), None),
        # It must foretell the held-out zero: halfway from nothing is as far from both, and the other side further.
        ((5.0,), 0.1, 4.0, (2.5,), None),
        ((5.0,), 0.1, 4.0, (-5.0,), None),
        # By a twentieth of the energy: variances 20.9 against 19.9, and 21.1 against 20.1.
        ((1.0,), 0.1, 4 * 19.9, (1.0,), Offset(1.0, 0.1, np.sqrt(20.9), np.sqrt(19.9))),
        ((1.0,), 0.1, 4 * 20.1, (1.0,), None),
    ],
)
def test_an_offset_stands_out_of_the_residual_and_foretells_the_held_out_zero(zeros, residual, held, there, wanted):
    found = fit(GAIN, zeros=zeros, energy=4 * residual**2)
    made = diagnose._offset(found, fit(GAIN, zeros=there, energy=held))
    assert (made is None) is (wanted is None)
    if made is not None:
        assert tuple(vars(made).values()) == pytest.approx(tuple(vars(wanted).values()))


def residual_of(one, values):
    return PairFit((), np.zeros(1), values, np.ones((len(values), 1)))


def wavy(n=600):
    t = np.arange(n) / RATE
    q = np.sin(3 * t) + 0.3 * np.sin(11 * t)
    return t, q, pair(run(q, 0 * q, load=np.cos(5 * t)))


@pytest.mark.parametrize("shape", [lambda q, t: np.sign(q), lambda q, t: np.abs(q), lambda q, t: t])
def test_a_curve_over_the_motion_is_found_where_no_effect_had_it(shape):
    """In noise of 0.1 it is nearly all there is; with its sign changing at random, nothing."""
    t, q, one = wavy()
    curve, rng = shape(q, t), np.random.default_rng(3)
    curve = curve / np.sqrt(np.mean(curve**2))
    mixed = curve + 0.1 * rng.normal(size=len(t))
    assert diagnose._nameless(one, residual_of(one, mixed - mixed.mean())) > 0.8
    assert diagnose._nameless(one, residual_of(one, mixed * rng.choice([-1.0, 1.0], len(t)))) == 0.0


def test_the_share_of_a_curve_is_what_a_ridge_regression_foretells_of_twelve_blocks():
    """Each of 50 samples by all the others, from the normal equations; columns of unit mean square, ridge 1e-6 n."""
    _, q, one = wavy()
    knots = np.linspace(q.min(), q.max(), 8)
    curve = np.interp(q, knots, np.r_[1.0, -1, 1, -1, 1, -1, 1, -1])
    curve = (curve - curve.mean()) / curve.std()
    noise = np.random.default_rng(5).normal(size=len(q))
    noise /= noise.std()
    residual, hats = curve + noise, smooth(one)
    columns = np.column_stack([np.ones(600), hats - hats.mean(0)])
    columns /= np.sqrt(np.mean(columns**2, axis=0))
    wrong = 0.0
    for block in np.split(np.arange(600), 12):
        rest = np.setdiff1d(np.arange(600), block)
        a, y = columns[rest], residual[rest]
        weights = np.linalg.solve(a.T @ a + 6e-4 * np.eye(a.shape[1]), a.T @ y)
        wrong += np.sum((residual[block] - columns[block] @ weights) ** 2)
    share = 1 - wrong / np.sum(residual**2)
    assert 0.3 < share < 0.5  # half of it is the curve
    assert diagnose._nameless(one, residual_of(one, residual)) == pytest.approx(share, rel=1e-6)


def test_what_the_columns_of_the_fit_explain_is_no_curve_and_an_empty_column_no_harm():
    """A block's own fit is not counted: of a residual along the fit's own column the same share is found without."""
    _, q, one = wavy()
    residual = np.sign(q)
    jacobian = np.stack([np.ones(len(q)), np.zeros(len(q)), residual], 1)
    assert diagnose._nameless(one, PairFit((), np.zeros(3), residual, jacobian)) > 0.99


def asked(monkeypatch, joints, also):
    """The joints diagnosed where fitted recordings compare some and the held-out one others; and what was asked."""
    seen, told = [], []
    files = {("a", "b"): (joints, "links"), ("h",): (also, "locked")}
    monkeypatch.setattr(diagnose, "load_links", lambda _m, paths, *_: files[tuple(paths)])
    monkeypatch.setattr(diagnose, "pair_of", lambda joint, _m, e, _a, _t, scales: (joint, e, scales))
    monkeypatch.setattr(diagnose, "_diagnose", lambda *given: seen.append(given) or given[0][0])
    scales: Any = {j: f"scale of {j}" for j in joints}
    found = diagnose_links(
        cast(Any, "model"), ["a", "b"], "h", NONE, NONE, NONE, scales, 20.0, progress=told.append, seed=7
    )
    return found, seen, told


def test_joints_that_both_sets_compare_are_diagnosed_in_order(monkeypatch):
    found, seen, told = asked(monkeypatch, ("j1", "j2", "j3"), ("j3", "j1"))
    assert found == (("j1", "j3"), "links")
    assert seen[1] == (("j3", "links", "scale of j3"), ("j3", "locked", "scale of j3"), "model", 2, 7)
    assert told == [f"comparing motor and link encoder of {j}" for j in ("j1", "j3")]


@pytest.mark.parametrize(("joints", "also"), [((), ("j1",)), (("j1",), ()), (("j1",), ("j2",))])
def test_where_either_set_has_no_second_encoder_nothing_is_diagnosed(monkeypatch, joints, also):
    assert asked(monkeypatch, joints, also)[0] == ((), [])


def proved(monkeypatch, searches, held, given: Any = (), values=None):
    """A diagnosis whose searches name these effects one after the other, and the held-out energies of each set.

    Also what every search was asked: effects given, their values, and what was barred.
    """
    seen = []

    def search(_pair, effects, start, _n, rejected, _seed):
        seen.append(([p.key for p in effects], start.tolist(), sorted(rejected)))
        tried, now = [], tuple(effects)
        for p in searches[len(seen) - 1] if len(seen) <= len(searches) else ():
            now = (*now, p)
            tried.append(named(p))
            tried[-1] = replace(tried[-1], trial=replace(tried[-1].trial, fit=fit(*now)))
        return Searched(tuple(tried), fit(*effects), NONE, (), NONE, float(len(seen)))

    monkeypatch.setattr(diagnose, "search_pair", search)
    monkeypatch.setattr(diagnose, "fit_pair", lambda _pair, effects, theta: replace(fit(*effects), theta=theta))
    monkeypatch.setattr(diagnose, "held_out", lambda _p, _l, now: fit(*now.placed, energy=held[now.placed]))
    monkeypatch.setattr(diagnose, "_nameless", lambda *_: 0.25)
    monkeypatch.setattr(diagnose, "_offset", lambda *_: "offset")
    model: Any = SimpleNamespace(effects=given, values=values or {})
    one = replace(pair(), runs=(NONE,))
    return diagnose._diagnose(one, one, model, 1, 0), seen


@pytest.mark.parametrize(("after", "confirmed"), [(99.9, True), (100.1, False)])
def test_an_effect_is_confirmed_if_without_it_the_energy_is_a_twentieth_higher(monkeypatch, after, confirmed):
    found, seen = proved(monkeypatch, [[GAIN]], {(): 105.0, (GAIN,): after})
    assert [p.named.trial.placed for p in found.proofs] == [GAIN] * confirmed
    assert found.rejected == (() if confirmed else (GAIN,))
    assert len(seen) == (1 if confirmed else 2)
    assert (found.offset, found.nameless, found.searched.bar) == ("offset", 0.25, 1.0)


def test_what_was_named_after_a_failure_is_not_proved_and_the_search_goes_on_from_what_was(monkeypatch):
    """Gain holds, drift does not, delay was named after it. The next search starts at the gain's value."""
    held = {(): 4.0, (GAIN,): 2.0, (GAIN, DRIFT): 2.0, (GAIN, SPRING): 1.0}
    found, seen = proved(monkeypatch, [[GAIN, DRIFT, DELAY], [SPRING]], held)
    assert seen == [([], [], []), ([GAIN.key], [1.0], [DRIFT.key])]
    assert [s.placed for s in found.steps] == [(), (GAIN,), (GAIN, SPRING)]
    assert [h.energy for h in found.held] == pytest.approx([4.0, 2.0, 1.0])
    assert [(p.without, p.within) for p in found.proofs] == [
        pytest.approx((1.0, np.sqrt(0.5))),
        pytest.approx((np.sqrt(0.5), 0.5)),
    ]
    assert found.rejected == (DRIFT,)


def test_after_three_searches_there_is_no_fourth(monkeypatch):
    held = dict.fromkeys([(), (GAIN,), (DRIFT,), (DELAY,), (SPRING,)], 4.0)
    found, seen = proved(monkeypatch, [[GAIN], [DRIFT], [DELAY], [SPRING]], held)
    assert [barred for _, _, barred in seen] == [[], [GAIN.key], sorted([GAIN.key, DRIFT.key])]
    assert found.rejected == (GAIN, DRIFT, DELAY)
    assert (len(found.steps), len(found.proofs), found.searched.bar) == (1, 0, 1.0)


def test_only_what_lies_between_the_two_encoders_is_taken_from_the_model(monkeypatch):
    """A spring and a drift at this joint; neither its friction nor another joint's spring, nor its shared zero."""
    own = (SPRING, DRIFT)
    others = [placed("coulomb_friction", "joint1"), placed("joint_elasticity", "joint2")]
    given = (others[0], SPRING, others[1], DRIFT, placed("sensor_bias", "q_link.joint1"))
    values = {"joint_elasticity.joint1.stiffness": 900.0, "sensor_drift.q_link.joint1.rate": 0.5}
    found, seen = proved(monkeypatch, [[]], {own: 4.0}, given, values)
    # The damper's usual value: a tenth of peak torque 8 over travel 0.5.
    assert seen == [([p.key for p in own], pytest.approx([900.0, 1.6, 0.5]), [])]
    assert found.offset is None
