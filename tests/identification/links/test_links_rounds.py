"""The order of the encoders' search: who goes first, who is tried again, where it ends; scores are given."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from encoder_pairs import RATE, pair, placed, run

from snarelab.identification.links import search
from snarelab.identification.links.search import Trial, library, search_pair

WAVE = np.sin(3 * np.arange(256) / RATE)
GAIN, DRIFT = placed("sensor_gain", "q_link.joint1"), placed("sensor_drift", "q_link.joint1")


def scripted(monkeypatch, scores):
    """A search whose trials have these scores, by round and effect; what is not there does not pass. Their keys."""
    rounds: list[list[str]] = []

    def trial(_pair, candidate, found, *_):
        number = len(found.placed) - found.placed.count(DRIFT)
        rounds.extend([] for _ in range(number + 1 - len(rounds)))
        rounds[number].append(candidate.key)
        score = scores[number].get(candidate.key) if number < len(scores) else None
        fit = SimpleNamespace(placed=(*found.placed, candidate), theta=np.append(found.theta, 1.0))
        made: Any = Trial(candidate, fit, np.zeros(1), 1.0, score or 0.0, 0.5, score is not None)  # pyright: ignore
        return made

    def fitted(_pair, effects, theta, *_):
        return SimpleNamespace(placed=tuple(effects), theta=theta)

    monkeypatch.setattr(search, "_trial", trial)
    monkeypatch.setattr(search, "fit_pair", fitted)
    monkeypatch.setattr(search, "_noise", lambda *_: None)
    monkeypatch.setattr(search, "_weigh", lambda best, others, *_: (best.placed.key, [t.placed.key for t in others]))
    return rounds


LATE, SPRING, PLAY = (x.key for x in (placed("sensor_delay", "q_link.joint1"), *library(pair())[4:]))
MOTOR = "sensor_delay.q.joint1"


def test_a_special_case_goes_first_and_a_second_delay_is_never_tried(monkeypatch):
    """Play scores most, but contains the spring; the spring named, play goes next. Rivals stand in order of score."""
    scores = [{PLAY: 90.0, SPRING: 50.0, LATE: 70.0, GAIN.key: 60.0}, {PLAY: 40.0, SPRING: 30.0}, {PLAY: 20.0}, {}]
    rounds = scripted(monkeypatch, scores)
    searched = search_pair(pair(run(WAVE, 0 * WAVE)), [], np.zeros(0), 1)
    assert list(searched.named) == [(LATE, [GAIN.key, SPRING]), (SPRING, []), (PLAY, [])]
    assert rounds[0] == [p.key for p in library(pair())]
    assert rounds[1] == [GAIN.key, DRIFT.key, SPRING, PLAY]  # neither delay again
    assert rounds[2] == [GAIN.key, DRIFT.key, PLAY]
    assert [t.placed.key for t in searched.opening] == rounds[0]
    assert [t.score for t in searched.opening][:3] == [0.0, 70.0, 60.0]


def test_what_is_barred_is_tried_but_not_taken_and_what_is_given_is_not_tried(monkeypatch):
    """Of two recordings that differ by 1 and 3 on average: the start is the given drift's value, then these zeros."""
    rounds = scripted(monkeypatch, [{LATE: 70.0, GAIN.key: 60.0}, {}])
    both = pair(run(WAVE, 1 + 0 * WAVE), run(WAVE, 3 + 0 * WAVE))
    searched = search_pair(both, [DRIFT], np.array([0.25]), 1, [LATE])
    assert [key for key, _ in cast(Any, searched.named)] == [GAIN.key]
    assert rounds[0] == [MOTOR, LATE, GAIN.key, SPRING, PLAY]
    assert searched.first.theta.tolist() == [0.25, 1.0, 3.0]
    assert searched.bar == pytest.approx(np.log(5 * 200))


def test_the_search_ends_after_eight_rounds(monkeypatch):
    """Nine effects of different names, all of which pass in every round."""
    names = ("coulomb_friction", "viscous_friction", "quadratic_friction", "torque_ripple", "sensor_gain")
    pool = [placed(name, "joint1") for name in names]
    pool += [placed(name, "joint1") for name in ("sensor_bias", "sensor_drift", "sensor_delay", "joint_elasticity")]
    monkeypatch.setattr(search, "library", lambda _: pool)
    scripted(monkeypatch, [{p.key: 50.0 for p in pool}] * 12)
    assert len(search_pair(pair(run(WAVE, 0 * WAVE)), [], np.zeros(0), 1).named) == 8
