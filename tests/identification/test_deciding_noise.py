"""Numbers of the noise, of sticking and of bursts, halved and doubled: an answer that stands at them must change."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from loud_windows import windows
from moved_numbers import FACTORS, about, move
from near_rest_of import near_rest

from snarelab.identification.arms import weigh as arm
from snarelab.identification.nuisance import rest
from snarelab.identification.nuisance.bursts import bursts
from snarelab.identification.nuisance.learn import learn
from snarelab.identification.nuisance.noise import NoiseChannel
from snarelab.identification.nuisance.rest import Zone


@pytest.mark.parametrize("constant", ["STICKS", "SETTLES"])
def test_where_a_joint_sticks_and_where_its_friction_settles(monkeypatch, constant):
    """Of a peak of 2: below 0.08 and 0.2; of a travel of 100, for 0.5 and 1.2 after it stood."""
    edge, after, at = {"STICKS": (0.08, 50, 0), "SETTLES": (0.2, 120, None)}[constant]
    speeds = [1.0, 1.9 * edge, 1.01 * edge, 0.99 * edge, 0.6 * edge, 0.4 * edge, 1.0]
    stood = np.concatenate([np.zeros(5), np.ones(400)])

    def told():
        zone = getattr(rest, constant) if at is None else getattr(rest, constant)[at]
        return len(near_rest(speeds, Zone(zone.speed, 0.0))), len(near_rest(stood, zone, 100.0)) - 5

    assert told() == (3, pytest.approx(after, abs=1))
    for factor, slow in zip(FACTORS, (1, 5), strict=True):
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert told() == (slow, pytest.approx(factor * after, abs=1))


def level(rest_torque: float) -> float:
    """What a joint of RMS torque 10 is said to hold, with this much left over at rest."""
    assembly: Any = SimpleNamespace(tree=SimpleNamespace(joints=[SimpleNamespace(name="joint1")]), placed=(), slots=())
    train: Any = [SimpleNamespace(motion=SimpleNamespace(to_band=lambda x: x, qd=np.eye(20)[:, :1]))]
    return arm._level(assembly, np.zeros(0), train, [np.full((20, 1), rest_torque)], 0, 10.0)


def test_a_joint_holds_something_at_least(monkeypatch):
    assert [level(x) for x in (0.1, 0.5)] == pytest.approx([0.3, 0.5])
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "LEAST_LEVEL", factor)
            assert level(0.1) == pytest.approx(0.3 * factor)


@pytest.mark.parametrize("count", [1, 6])
def test_odds_of_a_wander_are_those_of_all_channels_together(monkeypatch, count):
    """So the noise of each is told how many there are."""
    monkeypatch.setattr(arm, "learn", lambda *_, channels, **__: channels)
    motion: Any = SimpleNamespace(assembly=SimpleNamespace(base="free"), instruments=["a recording"], n_train=1)
    column = np.ones((4, 1))
    others: Any = SimpleNamespace(noise_beside=[[column] * count])
    columns: Any = SimpleNamespace(some=lambda *_: column)
    runs: Any = [["a channel"] * count]
    assert arm._noise(0, motion, [np.zeros((4, count))], runs, others, {}, {}, columns) == count


def test_a_level_that_wanders_must_show(monkeypatch):
    """The stronger its prior, the less of a weak wander is believed; its times are those that are tried."""
    rng, n, step = np.random.default_rng(7), 1200, 1 / 40
    decay = np.exp(-step / 8.0)
    walk = np.zeros(n)
    for k in range(1, n):
        walk[k] = decay * walk[k - 1] + np.sqrt(1 - decay**2) * rng.normal()
    nothing = np.zeros(n)
    run = NoiseChannel(step, (slice(0, n),), nothing, (nothing,), nothing, 0.0)
    t = step * np.arange(n)
    x = np.stack([np.sin(2 * np.pi * 0.21 * t), np.cos(2 * np.pi * 0.34 * t)], 1) * np.sqrt(2)

    def wander():
        noise = learn([0.25 * walk + 0.5 * rng_noise], [x], [run])
        return noise.wander, noise.wander_time

    rng_noise = rng.normal(size=n)
    level, time = wander()
    assert level > 0
    assert time in (2.0, 8.0, 40.0)
    more, as_it_is, less = about(monkeypatch, "WANDER_PRIOR", 5.0, lambda: wander()[0])
    assert less < as_it_is < more
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "WANDER_PRIOR", factor)
            found = wander()[0]
            assert (found < 0.995 * level) if factor > 1 else (found > 1.005 * level)
        with monkeypatch.context() as patch:
            move(patch, "WANDER_TIMES", factor)
            assert wander() != (level, time)


@pytest.mark.parametrize(("constant", "told"), [("BURST_LOUD", 7.0), ("BURST_SHARE", 7.0)])
def test_how_loud_and_how_much_makes_bursts(monkeypatch, constant, told):
    """One window of 5 beside eleven of 1 is none: 2 of 16 beyond three times the median; of 7 it is: 4 of 18."""

    def heard(loud):
        return bursts([windows(*11 * [1], loud)], []) is not None

    assert [heard(5), heard(told)] == [False, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            assert heard(5) is (factor < 1)
            assert heard(told) is (factor < 1)


def test_how_long_the_windows_of_bursts_are(monkeypatch):
    """Twelve are needed: of eleven half seconds nothing is said, of twelve it is; of as many halves of them, or so
    many whole seconds, otherwise."""

    def heard(count):
        return bursts([windows(*(count - 1) * [1], 16)], []) is not None

    assert [heard(11), heard(12), heard(23)] == [False, True, True]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, "BURST_WINDOW", factor)
            assert heard(11) is (factor < 1)
            assert heard(23) is (factor < 1)
