"""The held-out recordings' say: the name missed least goes first, blocks of time, and a name of one recording alone."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from decided import decided
from decided import names as named
from pendulum import record, recorded

from snarelab.identification.arms import kind as arms
from snarelab.identification.arms.blocks import FEWEST_BLOCKS, blocks
from snarelab.identification.arms.forecast import along_instruments, known_to
from snarelab.identification.decision import confirm as module
from snarelab.identification.decision.confirm import Loss, confirm
from snarelab.identification.evidence.forecast import Forecast
from snarelab.identification.fitting.fit import Fit
from snarelab.models.effects import get_effect
from snarelab.models.model import PlacedEffect

N = 6
NAMES = ("sensor_bias", "sensor_gain", "sensor_drift", "viscous_friction", "coulomb_friction", "backlash")


def names(n=N):
    return tuple(cast(Any, SimpleNamespace(placed=PlacedEffect(get_effect(x), "joint1"), number=k))
                 for k, x in enumerate(NAMES[:n]))  # fmt: skip


def missed_by(gain, fit=None, scatter_=1.0) -> Loss[Any]:
    return Loss(gain, scatter_, 0.2, 0, fit)


def eager(rise) -> set[int]:
    """What is left when every name is tried again after each that went."""
    left = set(range(N))
    while left:
        weakest = min(left, key=lambda k: rise(k, left))
        if rise(weakest, left) > 2:
            break
        left.remove(weakest)
    return left


def forecast(density: float) -> Forecast:
    return Forecast(density, (), np.zeros(0), np.zeros((0, 0)))


def confirmed(monkeypatch, some, missed, told=None):
    """`confirm` with a fit that is the set of names it has, and what is missed of each given by a function."""
    densities = iter(range(100))
    kind: Any = SimpleNamespace(forecast=lambda *_: forecast(float(next(densities))), known=lambda _, fit, whole: fit)
    monkeypatch.setattr(module, "loss", lambda _, __, name, final, ___: missed(name, final))
    found: Any = SimpleNamespace(names=some, last=frozenset(n.number for n in some))
    return confirm(kind, found, (told if told is not None else []).append)


@pytest.mark.parametrize("seed", range(20))
def test_trying_few_again_rules_out_what_trying_all_again_would(seed, monkeypatch):
    """Effects that stand in for each other are missed more once the other is gone: then the least missed is found
    without trying all."""
    rng = np.random.default_rng(seed)
    alone, stands_in = rng.uniform(0.0, 2.6, N), rng.uniform(0.0, 1.4, (N, N))
    tried = []

    def rise(number: int, left) -> float:
        return float(alone[number] + sum(stands_in[number, k] for k in range(N) if k not in left))

    def missed(name: Any, final: Any) -> Loss[Any]:
        tried.append(name.number)
        return missed_by(rise(name.number, final), final - {name.number})

    done: Any = confirmed(monkeypatch, names(), missed)
    left = {n.number for n in done.names}
    assert left == eager(rise) == done.last
    assert {n.number for n in done.rejected} == set(range(N)) - left
    assert set(done.missed) == {n.placed.key for n in done.names}
    assert set(done.weak) == {n.placed.key for n in done.rejected}
    gone = len(done.rejected)
    assert len(tried) <= N + sum(range(N - gone, N))  # no more than trying all again


def test_of_two_twins_one_stays(monkeypatch):
    def missed(name: Any, final: Any) -> Loss[Any]:
        return missed_by(0.4 if len(final) == 2 else 5.0, final - {name.number})

    done = confirmed(monkeypatch, names(2), missed)
    assert len(done.names) == len(done.rejected) == 1
    assert done.missed[done.names[0].placed.key].gain == 5.0


def test_of_a_law_and_its_special_case_the_law_goes_first(monkeypatch):
    """Though the special case is missed least: level and dip together, either of which can stand in for the other."""
    some = tuple(cast(Any, SimpleNamespace(placed=PlacedEffect(get_effect(x), "joint1"), number=k))
                 for k, x in enumerate(("coulomb_friction", "stribeck_friction", "backlash")))  # fmt: skip

    def missed(name: Any, final: Any) -> Loss[Any]:
        return missed_by(5.0 if len(final) == 2 else (0.2, 0.4, 0.6)[name.number], final - {name.number})

    done = confirmed(monkeypatch, some, missed)
    assert [n.placed.effect.name for n in done.rejected] == ["stribeck_friction"]


@pytest.mark.parametrize(("gain", "scattered", "stays"), [(4.0, 2.0, False), (4.01, 2.0, True), (-3.0, 0.1, False)])
def test_a_name_stays_if_it_is_missed_by_more_than_its_scatter(monkeypatch, gain, scattered, stays):
    told = []
    done: Any = confirmed(monkeypatch, names(1), lambda *_: missed_by(gain, "fit without", scattered), told)
    assert (len(done.names), len(done.rejected)) == ((1, 0) if stays else (0, 1))
    assert done.last == (frozenset([0]) if stays else "fit without")
    assert done.forecast.density == (0.0 if stays else 1.0)  # what is left predicts anew
    assert len(told) == (1 if stays else 2)


def test_without_a_name_nothing_is_tried(monkeypatch):
    done = confirmed(monkeypatch, (), lambda *_: pytest.fail("tried"))
    assert (done.names, done.rejected, dict(done.missed)) == ((), (), {})


def run(band: float) -> Any:
    return SimpleNamespace(motion=SimpleNamespace(band=band))


def test_blocks_are_of_one_and_a_half_seconds_and_add_up():
    x = np.random.default_rng(0).normal(size=1203)  # at 80 samples a second 15.04 s
    found = blocks(run(40.0), x)
    assert len(found) == 10
    assert found.sum() == pytest.approx(x.sum(), rel=1e-12)
    assert found[0] == pytest.approx(x[:121].sum(), rel=1e-12)
    assert len(blocks(run(40.0), x[:100])) == FEWEST_BLOCKS  # a short recording has a few all the same


def test_what_only_the_training_recording_has_is_not_named(tmp_path):
    """Drag of 1.2 N·m s² in the recording that is searched, and none in the one held out; and in both."""
    model = recorded(tmp_path, 3, drag=1.2)
    both = decided(model, tmp_path)
    record(tmp_path / "hold.csv", 1003, 12.0)
    one = decided(model, tmp_path)
    assert named(both) == ["quadratic_friction.joint1"]
    assert "quadratic_friction.joint1" not in named(one)
    assert "quadratic_friction.joint1" in [n.placed.key for n in one.rejected]


def test_deviations_are_about_the_reported_value():
    """Those of a posterior that is 0.3 and -0.4 off the fit; what the fit cannot determine stays so, and what the
    evidence holds, the fourth, is known as well as the fit knows it."""
    mean, variance = np.array([0.3, -0.4, 0.0, 0.0]), np.diag([0.16, 0.09, 0.01, 0.0])
    told = Forecast(0.0, (), mean, variance)
    own = np.diag([0.01, 81.0, 0.0, 4.0])
    at_bound, std = np.zeros(4, bool), np.array([0.1, 9.0, np.inf, 2.0])
    fit = Fit(cast(Any, None), np.ones(4), std, own, np.ones(1), 1.0, at_bound, 1, 1)
    known = known_to(fit, told)
    assert known.std == pytest.approx([0.5, 0.5, np.inf, 2.0])
    assert known.covariance[0, 1] == pytest.approx(-0.12)
    assert known.theta is fit.theta


def test_a_law_at_its_bound_predicts_nothing_of_the_wrong_sign(tmp_path):
    """Friction that falls by 1.5 N·m at a crawl is no Stribeck friction of -1.5 N·m."""
    model = recorded(tmp_path, 3, stribeck=-1.5, speed=0.3)
    there = model.with_effects([PlacedEffect(get_effect("stribeck_friction"), "joint1")], {})
    found = decided(there, tmp_path).best
    fit = found.last.fit
    level = [(s.effect, s.name) for s in fit.assembly.slots].index(("stribeck_friction", "level"))
    assert fit.theta[level] == 0.0
    assert fit.at_bound[level]
    assert found.forecast.mean[level] == found.forecast.covariance[level, level] == 0.0


def test_what_a_disturbance_moves_says_nothing_for_a_law():
    """A disturbance d moves an inertia of 1 as its servo lets it: a = m + d / 5, so that the torque is m - 4/5 d.

    Along the measured motion an inertia of 0.7 leaves less than the true one does; along the slow motion m alone, more.
    """
    rng = np.random.default_rng(1)
    slow, disturbance = np.sin(np.arange(400) / 40.0)[:, None], rng.normal(size=(400, 1))
    measured, torque = slow + 0.2 * disturbance, slow - 0.8 * disturbance

    def fitted(inertia) -> Any:
        return SimpleNamespace(theta=None, assembly=SimpleNamespace(residual=lambda a, _: (torque - inertia * a, [])))

    def left(motion) -> float:
        (found,) = along_instruments(fitted(0.7), fitted(1.0), [cast(Any, measured)], [motion])
        return float(np.mean(found**2))

    with_it = float(np.mean((torque - 0.7 * measured) ** 2))
    assert left(measured) == pytest.approx(float(np.mean((torque - measured) ** 2)))
    assert left(slow) < with_it < left(measured)


def test_a_name_is_tried_along_the_instrument_motion(monkeypatch):
    """Fits that leave -theta times a motion: 1 with the name, 2 without. Instruments are ten times the motions."""
    asked = []

    def fitted(theta) -> Any:
        return SimpleNamespace(theta=theta, assembly=SimpleNamespace(residual=lambda x, own: (-own * x, [])))

    def told(*given: Any) -> Forecast:
        asked.append(given[5:])
        return forecast(0.0)

    monkeypatch.setattr(arms, "forecast", told)
    found: Any = SimpleNamespace(last=SimpleNamespace(instruments=[10.0, 20.0]))
    own, rest = (cast(Any, SimpleNamespace(model=None, fit=fitted(x))) for x in (1.0, 2.0))
    nothing: Any = None
    arm = arms.ArmRecordings(nothing, None, {}, cast(Any, [1.0]), cast(Any, [2.0]))
    arm.forecast_without(found, nothing, own, rest)
    assert asked == [([-1.0 - 10.0, -2.0 - 20.0],)]


def test_what_is_missed_is_told_where_the_two_models_differ_most(monkeypatch):
    """Of the name's own channels, 0 and 2; its curves do not stand in for it."""
    rows = iter([forecast(7.0), forecast(4.0)])
    kind: Any = SimpleNamespace(
        without=lambda found, fit, key: (fit, key),
        forecast=lambda found, fit: next(rows),
        forecast_without=lambda found, name, fit, rest: next(rows),
        apart=lambda one, other: np.array([0.1, 0.9, 0.3]),
        held=range(0),
    )
    monkeypatch.setattr(module, "without_its_curves", lambda *_: "without its curves")
    monkeypatch.setattr(module, "scatter", lambda *_: 1.5)
    (name,) = names(1)
    name.channels = (0, 2)
    missed = module.loss(kind, cast(Any, "with its curves"), name, cast(Any, "fit"), forecast(100.0))
    assert (missed.gain, missed.sure, missed.size, missed.channel) == (3.0, 2.0, 0.3, 2)
    assert missed.fit == ("fit", name.placed.key)


@pytest.mark.parametrize(("size", "told"), [(0.0005, False), (0.002, True)])
def test_what_is_smaller_than_any_models_error_is_not_told(size, told):
    assert Loss(42.0, 1.0, size, 0, None).told is told
