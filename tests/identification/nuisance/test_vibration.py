"""Vibration that is alone in a channel, of structures and joints with equations of their own; and none of noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt
from shaken import chattering, rung

from snarelab.identification.nuisance.noise import Noise, NoiseChannel
from snarelab.identification.nuisance.vibration import vibrating

STEP, N = 1 / 40, 1200
SPEED = np.abs(np.sin(2 * np.pi * 0.11 * STEP * np.arange(N)) + 0.4 * np.sin(2 * np.pi * 0.29 * STEP * np.arange(N)))
PACE = SPEED / SPEED.max()
NOISE = Noise(1.0, 0.5, 0.1, 0.0, 8.0, 0.0)


def run(pace=PACE, n=N) -> NoiseChannel:
    nothing = np.zeros(n)
    return NoiseChannel(STEP, (slice(0, n),), nothing, (nothing,), nothing, 0.0, pace=pace)


def quiet(rng, n=N):
    decay = np.exp(-STEP / 0.1)
    return 0.2 * rng.normal(size=n) + 0.3 * np.asarray(
        lfilter([np.sqrt(1 - decay**2)], [1, -decay], rng.normal(size=n))
    )


def gain(residual, found: Noise, without: Noise) -> float:
    """[nats] of the likelihood and of the prior."""
    with_it, alone = (np.sum(x.covariance(run()).log_density(residual)) + x.log_prior for x in (found, without))
    return float(with_it - alone)


@pytest.mark.parametrize("hertz", [2.5, 4.0, 7.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_joint_that_chatters_at_some_speeds_has_its_frequency_and_these_speeds(seed, hertz):
    rng = np.random.default_rng(seed)
    residual = quiet(rng) + chattering(rng, (PACE > 0.3) & (PACE < 0.6), STEP, hertz)
    found = vibrating([residual], [run()], NOISE)
    v = found.vibration
    assert v is not None
    assert not v.steady
    assert v.frequency == pytest.approx(hertz, rel=0.05)
    assert 0.3 <= v.pace <= 0.6
    assert np.hypot(found.white, found.coloured) == pytest.approx(np.hypot(0.2, 0.3), rel=0.4)
    assert found.still.vibration is None or found.still.vibration.steady
    assert gain(residual, found, found.still) > 0
    assert found.plain.vibration is None


def test_noise_that_vibrates_nowhere_is_none():
    """The likeliest of some hundred trials does not outweigh its prior: never at some speeds, else 3 times in 40."""
    found = [vibrating([quiet(np.random.default_rng(100 + seed))], [run()], NOISE).vibration for seed in range(40)]
    assert not [v for v in found if v and not v.steady]
    assert sum(v is not None for v in found) <= 3


@pytest.mark.parametrize("seed", range(3))
def test_what_vibrates_at_any_speed_is_told_apart(seed):
    """A line of the spectrum, and noise that ends at an edge: neither goes with a speed."""
    rng = np.random.default_rng(200 + seed)
    for residual in (
        quiet(rng) + rung(rng, np.ones(N), STEP, 4.0, 0.02),
        np.asarray(sosfilt(butter(2, (0.3, 6.0), "bandpass", fs=1 / STEP, output="sos"), rng.normal(size=N))),
    ):
        found = vibrating([residual + 0.02 * rng.normal(size=N)], [run()], NOISE)
        assert found.vibration is not None
        assert found.vibration.steady
        assert found.still is found


def test_what_dies_within_a_period_or_two_is_no_vibration():
    rng = np.random.default_rng(3)
    residual = quiet(rng) + rung(rng, (PACE > 0.5).astype(float), STEP, 3.0, 0.5)
    found = vibrating([residual], [run()], NOISE).vibration
    assert found is None or 2 * np.pi * found.frequency * found.decay >= 20 * (1 - 1e-9)


def test_without_a_speed_nothing_vibrates():
    rng = np.random.default_rng(4)
    residual = quiet(rng) + rung(rng, np.ones(N), STEP, 4.0, 0.01)
    assert vibrating([residual], [run(pace=None)], NOISE) is NOISE


def test_what_vibrated_before_is_looked_for_anew():
    rng = np.random.default_rng(5)
    residual = quiet(rng) + chattering(rng, PACE > 0.4, STEP, 4.0)
    first = vibrating([residual], [run()], NOISE)
    again = vibrating([residual], [run()], replace(first, white=1.0, coloured=0.5))
    assert first.vibration is not None
    assert again.vibration is not None
    assert not again.vibration.steady
    assert again.vibration.frequency == pytest.approx(first.vibration.frequency, rel=0.02)
