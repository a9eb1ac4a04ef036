"""The time base: period, jitter and gaps of made-up clocks whose gaps are known."""

import numpy as np
import pytest
import xarray as xr

from snarelab.recordings import sampling


def dataset(time, **signals):
    values = signals or {"q.j": np.ones(len(time))}
    return xr.Dataset(
        {name.replace("_j", ".j"): ("time", np.asarray(value)) for name, value in values.items()}, {"time": time}
    )


def test_even():
    rate = sampling(dataset(np.arange(1000) * 0.004))
    assert rate.period == pytest.approx(0.004)
    assert rate.jitter < 1e-9
    assert rate.gaps == ()
    assert rate.uniform


def test_even_with_absolute_stamps():
    assert sampling(dataset(1.7e9 + np.arange(1000) * 0.001)).uniform


def test_jitter_is_relative_and_leaves_gaps_out():
    time = np.arange(101) * 0.01
    time[50:] += 0.002
    time[80:] += 5.0
    rate = sampling(dataset(time))
    assert rate.jitter == pytest.approx(0.2)
    assert len(rate.gaps) == 1
    assert rate.gaps[0] == pytest.approx((time[79], time[80]))
    assert not rate.uniform


def test_step_limit():
    below = np.array([0.0, 1.0, 2.0, 3.0, 4.45, 5.45])
    above = np.array([0.0, 1.0, 2.0, 3.0, 4.55, 5.55])
    assert sampling(dataset(below)).gaps == ()
    assert sampling(dataset(above)).gaps == ((3.0, 4.55),)


def test_rows_without_any_joint_signal_are_a_gap():
    nan = np.nan
    position = [1, nan, nan, 1, nan, 1, 1, nan]
    torque = [1, nan, nan, 1, 1, 1, 1, nan]
    rate = sampling(dataset(np.arange(8.0), q_j=position, tau_j=torque, temp_j=np.ones(8)))
    assert rate.gaps == ((0.0, 3.0), (6.0, 7.0))
    assert not rate.uniform


def test_a_missing_stretch_and_a_long_step_are_one_gap():
    position = np.ones(10)
    position[4] = np.nan
    time = np.arange(10.0)
    time[5:] += 3.0
    assert sampling(dataset(time, q_j=position)).gaps == ((3.0, 8.0),)


def test_without_joints_all_signals_count():
    values = xr.Dataset({"pos.body.x": ("time", [1.0, np.nan, 1.0])}, {"time": [0.0, 1.0, 2.0]})
    assert sampling(values).gaps == ((0.0, 2.0),)
