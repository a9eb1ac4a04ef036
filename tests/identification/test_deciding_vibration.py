"""Numbers of vibration, halved and doubled: what is found of joints that vibrate at their edges must change."""

import numpy as np
import pytest
from moved_numbers import FACTORS, move
from shaken import rung

from snarelab.identification.nuisance.noise import Noise, NoiseChannel
from snarelab.identification.nuisance.vibration import vibrating

STEP, N = 1 / 40, 1600
PACE = np.abs(np.sin(2 * np.pi * 0.09 * STEP * np.arange(N)))
NOISE = Noise(0.5, 0.1, 0.1, 0.0, 8.0, 0.0)


def found(hertz: float, damping: float, pace: float = 0.45, wide: float = 0.15):
    """Vibration that is found of one about a pace, so wide [shares of the peak speed]; None where there is none."""
    rng = np.random.default_rng(1)
    shaken = rung(rng, np.ones(N), STEP, hertz, damping) * np.exp(-(((PACE - pace) / wide) ** 2) / 2)
    nothing = np.zeros(N)
    run = NoiseChannel(STEP, (slice(0, N),), nothing, (nothing,), nothing, 0.0, pace=PACE)
    return vibrating([shaken + 0.2 * rng.normal(size=N)], [run], NOISE).vibration


def told_of(hertz: float, damping: float, pace: float = 0.45, wide: float = 0.15):
    v = found(hertz, damping, pace, wide)
    assert v is not None
    return v


def moved(monkeypatch, constant, told):
    """An answer as it is, with half the number and with twice it."""
    answers = [told()]
    for factor in FACTORS:
        with monkeypatch.context() as patch:
            move(patch, constant, factor)
            answers.append(told())
    return answers


def test_speeds_about_which_a_joint_may_vibrate(monkeypatch):
    """The fastest is out of reach at half of them, the slowest at twice."""

    def told():
        return [told_of(4.0, 0.02, pace).pace for pace in (0.15, 0.8)]

    as_they_are, halved, doubled = moved(monkeypatch, "VIBRATION_PACES", told)
    assert as_they_are == [0.15, 0.8]
    assert halved[1] < 0.8
    assert doubled[0] > 0.15


def test_how_far_about_a_speed_a_joint_vibrates(monkeypatch):
    def told():
        return [told_of(4.0, 0.02, wide=wide).wide for wide in (0.15, 0.3)]

    as_they_are, halved, doubled = moved(monkeypatch, "VIBRATION_WIDTHS", told)
    assert as_they_are == [0.15, 0.3]
    assert 0.3 not in halved
    assert 0.15 not in doubled


@pytest.mark.parametrize(
    ("constant", "hertz", "lost_by"), [("VIBRATION_SLOWEST", 1.3, 2.0), ("VIBRATION_RESOLVED", 13.0, 0.5)]
)
def test_frequencies_at_the_edges_are_found(monkeypatch, constant, hertz, lost_by):
    """1.3 Hz, and 13 Hz of 40 samples a second, to 3 %; with twice the lowest or half the highest they are not."""

    def off():
        v = found(hertz, 0.01)
        return abs(v.frequency / hertz - 1) if v else 1.0

    assert off() < 0.03
    with monkeypatch.context() as patch:
        move(patch, constant, lost_by)
        assert off() > 0.1


@pytest.mark.parametrize("constant", ["VIBRATION_SLOWEST", "VIBRATION_RESOLVED"])
def test_trials_that_a_vibration_is_the_best_of(monkeypatch, constant):
    """Ten speeds, and lines of a spectrum from 1 to 14 Hz that are as wide as its decay lets them be."""

    def told():
        v = told_of(4.0, 0.02)
        return v.trials / v.decay

    as_it_is, halved, doubled = moved(monkeypatch, constant, told)
    assert as_it_is == pytest.approx(10 * 13)
    assert halved == pytest.approx(10 * {"VIBRATION_SLOWEST": 13.5, "VIBRATION_RESOLVED": 6}[constant])
    assert doubled == pytest.approx(10 * {"VIBRATION_SLOWEST": 12, "VIBRATION_RESOLVED": 27}[constant])


def test_what_dies_too_fast_is_no_vibration(monkeypatch):
    """Of damping ratios of 3.5 and 20 %, the first is found as it is, and the second as one of 5 % at most."""

    def told():
        found_at = [told_of(4.0, ratio) for ratio in (0.035, 0.2)]
        return [1 / (2 * np.pi * v.frequency * v.decay) for v in found_at]

    as_it_is, halved, doubled = moved(monkeypatch, "VIBRATION_DAMPING", told)
    assert as_it_is == [pytest.approx(0.035, abs=0.015), pytest.approx(0.05, rel=1e-6)]
    assert halved[0] < 0.0251
    assert doubled[1] > 0.055
