"""Gaps, holes and clocks that are not even: nothing crosses a gap, and what bridges a hole is said."""

import numpy as np
import pytest
from condition_signals import BAND, RATE, clock, noted, recording, sine

from snarelab.recordings.condition import condition


def test_a_gap_in_time_splits_and_nothing_crosses_it():
    t = clock(12.0)
    keep = (t < 5.0) | (t > 6.5)
    t = t[keep]
    # The joint is somewhere else after the gap: a filter that crossed it would ring.
    after = t > 6.0
    q = sine(t, 1.0)[0] + 5.0 * after
    tau = np.where(after, 100.0, -100.0)
    motion = condition(recording(t, q, tau), ["joint1"], BAND)
    assert len(motion.segments) == 2
    noted(motion, "2 runs", "nothing is interpolated")
    np.testing.assert_allclose(motion.qdd[:, 0], sine(motion.time, 1.0)[2], atol=1e-3 * (2 * np.pi) ** 2)
    banded, at = motion.to_band(motion.tau)[:, 0], motion.to_band(motion.time)
    np.testing.assert_allclose(banded, np.where(at > 6.0, 100.0, -100.0), atol=1e-9)
    assert np.all((at < 5.0) | (at > 6.5))
    first, second = motion.band_segments()
    assert at[first][-1] < 5.0 < 6.5 < at[second][0]
    assert second.stop == len(at)


@pytest.mark.parametrize("channel", ["q", "tau"])
def test_a_missing_sample_of_any_joint_splits_all(channel):
    t = clock(12.0)
    q, tau = np.stack([sine(t, 1.0)[0], sine(t, 0.5)[0]], 1), np.ones((len(t), 2))
    (q if channel == "q" else tau)[1200:1203, 1] = np.nan
    motion = condition(recording(t, q, tau, ("joint1", "joint2")), ["joint1", "joint2"], BAND)
    assert len(motion.segments) == 2
    noted(motion, "3 of 2400 samples", "missing")
    for values in (motion.q, motion.qd, motion.qdd, motion.tau):
        assert np.all(np.isfinite(values))
    np.testing.assert_allclose(motion.qdd[:, 1], sine(motion.time, 0.5)[2], atol=1e-3 * np.pi**2)
    assert not np.any((motion.time > t[1199]) & (motion.time < t[1203]))


def test_a_gap_in_which_only_the_position_is_missing_keeps_the_time_of_the_rest():
    t = clock(12.0)
    q = sine(t, 1.0)[0]
    q[:400] = np.nan  # an encoder that woke up late
    motion = condition(recording(t, q, t), ["joint1"], BAND)
    assert len(motion.segments) == 1
    assert motion.time[0] > 2.0
    np.testing.assert_allclose(motion.tau[:, 0], motion.time, atol=1e-12)


def test_runs_too_short_to_filter_are_left_out_and_said():
    t = clock(12.0)
    q = sine(t, 1.0)[0]
    q[[1000, 1030]] = np.nan
    motion = condition(recording(t, q), ["joint1"], BAND)
    assert len(motion.segments) == 2
    noted(motion, "29 samples from 5.005 s", "left out")
    np.testing.assert_allclose(motion.qdd[:, 0], sine(motion.time, 1.0)[2], atol=1e-3 * (2 * np.pi) ** 2)


def test_uneven_stamps_are_resampled_said_and_right():
    rng = np.random.default_rng(1)
    t = clock() + rng.uniform(-0.25, 0.25, round(10 * RATE)) / RATE
    motion = condition(recording(t, sine(t, 2.0)[0], sine(t, 2.0)[0]), ["joint1"], BAND)
    noted(motion, "uneven", "cubic splines")
    np.testing.assert_allclose(np.diff(motion.time), motion.period, rtol=1e-9)
    for found, wanted in zip((motion.q, motion.qd, motion.qdd), sine(motion.time, 2.0), strict=True):
        assert np.max(np.abs(found[:, 0] - wanted)) < 5e-3 * np.max(np.abs(wanted))
    np.testing.assert_allclose(motion.tau[:, 0], sine(motion.time, 2.0)[0], atol=1e-4)


def test_a_run_at_another_rate_is_not_taken_at_the_first_ones():
    slow = 12.0 + clock(10.0, RATE / 1.2)
    t = np.concatenate([clock(10.5), slow])
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)
    assert len(motion.segments) == 2
    noted(motion, "1 runs are not sampled at 200 Hz")
    for s in motion.segments:
        np.testing.assert_allclose(motion.qd[s, 0], sine(motion.time[s], 1.0)[1], atol=0.01 * 2 * np.pi)


def holed(kind, rng):
    """Stamps and which samples have a torque: little is left between gaps, though no hole is long."""
    t, known = clock(20.0), None
    if kind == "jitter":
        t = t + rng.uniform(-0.4, 0.4, len(t)) / RATE
    elif kind == "rows":
        t = t[rng.random(len(t)) > 0.05]
    known = np.ones(len(t), bool)
    if kind == "cells":
        known = rng.random(len(t)) > 0.03
    elif kind == "two clocks":
        known = np.arange(len(t)) % 4 > 1
    return t, known


@pytest.mark.parametrize("kind", ["jitter", "rows", "cells", "two clocks"])
@pytest.mark.parametrize("band", [None, BAND])
def test_short_holes_are_bridged_where_little_would_be_left_between_them(kind, band):
    t, known = holed(kind, np.random.default_rng(3))
    tau = np.full(len(t), np.nan)
    tau[known] = sine(t, 2.0)[1][known]
    motion = condition(recording(t, sine(t, 2.0)[0], tau), ["joint1"], band)
    longest = np.max(np.diff(t[known]))
    noted(motion, "bridged by cubic splines", f"{1e3 * longest:.3g} ms")
    assert motion.band <= 1 / (2 * longest) + 1e-9
    assert len(motion.time) > 0.95 * (t[-1] - t[0]) * RATE
    # Cubic splines between samples a step apart: (5/384) step^4 w^4 of the size.
    error = 5 / 384 * (longest * 4 * np.pi) ** 4
    np.testing.assert_allclose(motion.q[:, 0], sine(motion.time, 2.0)[0], atol=2 * error + 1e-5)
    np.testing.assert_allclose(motion.tau[:, 0], sine(motion.time, 2.0)[1], atol=4 * np.pi * (2 * error + 1e-5))
    np.testing.assert_allclose(motion.qdd[:, 0], sine(motion.time, 2.0)[2], atol=0.01 * (4 * np.pi) ** 2)


def test_a_recording_may_change_its_rate():
    t = np.concatenate([clock(8.0), 8.0 + clock(8.0, RATE / 2)])
    motion = condition(recording(t, sine(t, 1.0)[0]), ["joint1"], BAND)
    assert motion.time[-1] > 15.5
    noted(motion, "1 runs are not sampled at 200 Hz")
    np.testing.assert_allclose(motion.qdd[:, 0], sine(motion.time, 1.0)[2], atol=1e-3 * (2 * np.pi) ** 2)
    slow = np.concatenate([clock(8.0), 8.0 + clock(8.0, 30.0)])
    motion = condition(recording(slow, sine(slow, 1.0)[0]), ["joint1"], BAND)
    assert motion.time[-1] < 8.0
    noted(motion, "sampled at 30 Hz, too slow for the band: left out")
