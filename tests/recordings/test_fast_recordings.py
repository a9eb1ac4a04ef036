"""Recordings that come far faster than any band needs are thinned before anything else, and stay where they were."""

import numpy as np
import pytest
import xarray as xr

from snarelab.recordings.condition import condition

TURN = 2 * np.pi * 1.5
"""Of a motion at 1.5 Hz [rad/s]."""


def recorded(rate: float, seconds: float = 8.0, cut: tuple[float, float] = (0.0, 0.0)) -> xr.Dataset:
    """A sine with a tone at 800 Hz on its torque, which a slower clock would fold into the band; a hole in time."""
    t = np.arange(round(seconds * rate)) / rate
    t = t[~((t > cut[0]) & (t < cut[1]))]
    tau = 3.0 * np.cos(TURN * t) + 2.0 * np.sin(2 * np.pi * 800.0 * t)
    return xr.Dataset({"q.a": ("time", np.sin(TURN * t)), "tau.a": ("time", tau)}, {"time": t})


@pytest.mark.parametrize(("rate", "every"), [(5000.0, 16), (2000.0, 6), (1400.0, 1)])
def test_the_clock_is_three_times_what_the_widest_band_needs(rate, every):
    motion = condition(recorded(rate), ("a",), 20.0)
    assert motion.period == pytest.approx(every / rate, rel=1e-9)
    assert any(f"every {every} samples make one" in n for n in motion.notes if "recorded at" in n) == (every > 1)


def test_motion_and_torque_are_those_of_their_time():
    """By the sine's own derivatives, at the stamps that are left; of the tone nothing is."""
    motion = condition(recorded(5000.0), ("a",), 20.0)
    t = motion.time
    np.testing.assert_allclose(motion.q[:, 0], np.sin(TURN * t), atol=2e-4)
    np.testing.assert_allclose(motion.qd[:, 0], TURN * np.cos(TURN * t), atol=2e-4 * TURN)
    np.testing.assert_allclose(motion.qdd[:, 0], -(TURN**2) * np.sin(TURN * t), atol=1e-3 * TURN**2)
    np.testing.assert_allclose(motion.tau[:, 0], 3.0 * np.cos(TURN * t), atol=2e-3)


def test_a_hole_stays_a_hole():
    motion = condition(recorded(5000.0, cut=(3.0, 4.0)), ("a",), 20.0)
    assert len(motion.segments) == 2
    first, second = (motion.time[s] for s in motion.segments)
    assert first[-1] < 3.0 < 4.0 < second[0]
    assert np.ptp(np.diff(first)) < 1e-9
