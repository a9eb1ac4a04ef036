"""The numbers of the torques' answer by hand: misfits, noise floors, parameters, traces, excitation."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from encoder_pairs import RATE
from small_answers import MODEL, NAMES, experiment, fit

from snarelab.identification import answer


def test_misfits_are_root_mean_squares_over_all_recordings_of_a_set(monkeypatch):
    """Fitted: a torque of 4 modelled as 2, then 3; held out 10, as 2 and 3. Channels 2 and 3 with other numbers."""
    monkeypatch.setattr(answer, "_noise_floor", lambda *_: np.array([0.1, 0.2, 0.3]))
    train = [experiment(np.tile([4.0, 8.0, 5.0], (n, 1))) for n in (4, 8)]
    fits = answer.channel_fits(
        MODEL, fit([2, 0, 5]), fit([3, 4, 6]), train, [experiment(np.tile([10.0, 2.0, 5.0], (4, 1)))]
    )
    assert [(f.channel, f.unit, f.noise_floor) for f in fits] == [
        ("tau.joint1", "N*m", 0.1),
        ("tau.joint2", "N", 0.2),
        ("tau.joint3", "N*m", 0.3),
    ]
    assert [tuple(vars(f.train).values()) for f in fits] == [(2, 1, 0.5, 0.25), (8, 4, 1.0, 0.5), (0, 1, 0, 0.2)]
    assert [tuple(vars(f.holdout).values()) for f in fits] == [(8, 7, 0.8, 0.7), (2, 2, 1, 1), (0, 1, 0, 0.2)]


def noisy(sigmas, band=4.0, segments=None, n=8192, seed=0):
    """White noise of these deviations at 64 samples a second, beside a slow motion and a single line at 20 Hz."""
    t = np.arange(n) / RATE
    other = 3 + 5 * np.sin(2 * np.pi * 3 * t) + 0.1 * np.sin(2 * np.pi * 20 * t)
    tau = np.random.default_rng(seed).normal(size=(n, 3)) * sigmas + other[:, None]
    if segments:
        tau[segments[0]] = 0.0
    made = experiment(tau, segments=segments)
    return replace(made, motion=replace(made.motion, band=band))


def test_a_noise_floor_is_white_noise_of_the_longest_run_above_twice_the_band():
    """In 4 of 32 Hz; the smallest of all recordings', channel by channel. A model's torque does not count."""
    final = fit([3.0, 3.0, 3.0])
    one = noisy([1e-2, 1e-3, 1.0], segments=(slice(0, 1000), slice(1000, 8192)))
    two = noisy([2e-2, 5e-4, 2.0], seed=1)
    part = np.sqrt(4 / 32)
    assert answer._noise_floor([one], final) / part == pytest.approx([1e-2, 1e-3, 1.0], rel=0.07)
    assert answer._noise_floor([one, two], final) / part == pytest.approx([1e-2, 5e-4, 1.0], rel=0.07)


def test_a_wide_bands_noise_floor_is_what_is_above_four_tenths_of_the_rate():
    """Of noise a thousand times as loud below 0.35 of the rate."""
    n = 8192
    spectrum = np.fft.rfft(np.random.default_rng(1).normal(size=(n, 3)), axis=0)
    spectrum[np.fft.rfftfreq(n) < 0.35] *= 1000
    e = experiment(np.fft.irfft(spectrum, n, axis=0))
    assert answer._noise_floor([e], fit([0, 0, 0])) == pytest.approx([1.0] * 3, rel=0.07)


def test_a_noise_floor_is_what_the_model_leaves_from_twice_the_band_on():
    """Modelled is a torque a thousand times as loud. Of 8 to 32 Hz the noise is loud up to 21 Hz, in 13 of 24: the
    median has 11 quiet ones below it, and 1 / 26 of the loud: of their exponential law's mean -ln(1 - 1 / 13)."""
    n = 8192
    rng = np.random.default_rng(2)
    spectrum = np.fft.rfft(rng.normal(size=(n, 3)), axis=0)
    spectrum[np.fft.rfftfreq(n, 1 / RATE) > 21] *= 1e-3
    modelled = 1e3 * rng.normal(size=(n, 3))
    e = experiment(np.fft.irfft(spectrum, n, axis=0) + modelled)
    e = replace(e, motion=replace(e.motion, band=4.0))
    final: Any = SimpleNamespace(assembly=SimpleNamespace(torque=lambda *_: modelled), theta=None)
    wanted = np.sqrt(4 / 32 * -np.log(1 - 1 / 13) / np.log(2))
    assert answer._noise_floor([e], final) == pytest.approx([wanted] * 3, rel=0.2)


def test_a_floating_bases_noise_floor_is_its_momentums(monkeypatch):
    monkeypatch.setattr(answer, "momentum_floor", lambda _: np.array([7.0, 8.0]))
    floating: Any = SimpleNamespace(tree=SimpleNamespace(carriers=2))
    one = replace(noisy([1.0, 1.0, 1.0]), body=floating)
    floors = answer._noise_floor([one] * 2, fit([0, 0, 0]))
    assert floors[:2].tolist() == [7.0, 8.0]
    assert floors[2] == pytest.approx(np.sqrt(4 / 32), rel=0.07)


def test_parameters_that_stay_in_the_model_are_told_before_and_after():
    def slots(*keys):
        return {"slots": [SimpleNamespace(key=k, unit=f"unit of {k}") for k in keys]}

    first, final = fit([1, 2, 3], assembly=slots("a", "b", "c")), fit([30, 20, 10], assembly=slots("c", "x", "a"))
    final.std = np.array([0.3, 0.2, 0.1])
    assert [tuple(vars(m).values()) for m in answer.moved(first, final)] == [
        ("a", "unit of a", 1.0, 10.0, 0.1),
        ("c", "unit of c", 3.0, 30.0, 0.3),
    ]


def test_every_channel_of_every_recording_has_a_trace():
    """Position k and speed 10 k of joint k, torque 100 k; models 1, 2, 3 and 4, 5, 6."""
    k = np.array([1.0, 2.0, 3.0])
    es = [experiment(np.tile(100 * k, (2, 1)), f"/d/{n}.csv", q=np.tile(k, (2, 1)), qd=np.tile(10 * k, (2, 1)))
          for n in "abh"]  # fmt: skip
    made = answer.traces(fit([1, 2, 3]), fit([4, 5, 6]), es[:2], es[2:])
    assert [(t.recording, t.role, t.channel, t.unit) for t in made] == [
        (f"{n}.csv", "holdout" if n == "h" else "train", f"tau.{j}", u)
        for n in "abh"
        for j, u in zip(NAMES, ("N*m", "N", "N*m"), strict=True)
    ]
    assert made[4].time.tolist() == [100.0, 100 + 1 / 64]
    arrays = (made[4].position, made[4].speed, made[4].measured, made[4].before, made[4].after)
    assert [x.tolist() for x in arrays] == [[x, x] for x in (2.0, 20.0, 200.0, 2.0, 5.0)]


def test_excitation_counts_reversals_among_the_samples_in_motion():
    """Faster than a twentieth of the peak of 2: of eight samples in two recordings five, four, and all."""
    one = np.array([[2, 1, -1], [0.12, 1, 1], [-0.12, 0.05, -1], [0.1, 0, 1]])
    two = np.array([[1, -2, 1], [-1, -1, 1], [0.02, 0, 1], [0, 0.1, 1.0]])
    es = [experiment(np.zeros((4, 3)), qd=qd) for qd in (one, two)]
    assert answer._excitation(es) == [
        "excitation of joint1: moving 62 % of the time, 3 reversals",
        "excitation of joint2: moving 50 % of the time, 1 reversals",
        "excitation of joint3: moving 100 % of the time, 3 reversals",
    ]
