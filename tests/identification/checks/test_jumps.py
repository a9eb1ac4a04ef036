"""Where a position jumps, and where only its time stamps do."""

import numpy as np
import pytest
import xarray as xr

from snarelab.identification.checks.kinds.jump import jumps

RATE, COUNT = 100.0, 2.0 * np.pi / 2.0**23


def moves(seed, jitter, rate=RATE, seconds=20.0):
    """Smooth moves with stops of a joint, read by an encoder of 23 bits; stamps off by a share of a period."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    q = np.zeros(len(t))
    for start in np.arange(0.5, seconds - 2.5, 2.5):
        s = np.clip((t - start) / rng.uniform(0.7, 2.0), 0.0, 1.0)
        q += rng.uniform(-1.0, 1.0) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return t + jitter / rate * rng.standard_normal(len(t)), COUNT * np.round(q / COUNT)


def found(t, q):
    return jumps(xr.Dataset({"q.joint1": ("time", q)}, coords={"time": t}), "q.joint1")


@pytest.mark.parametrize("jitter", [0.0, 0.005, 0.02, 0.05])
def test_stamps_that_jitter_are_no_jumps(jitter):
    assert [found(*moves(seed, jitter)) for seed in range(20)] == [[]] * 20


@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_jump_is_found_while_the_joint_moves(jitter):
    hits = 0
    for seed in range(20):
        t, q = moves(seed, jitter)
        at = int(np.random.default_rng(seed).integers(300, 1700))
        q[at:] += 0.2
        told = found(t, q)
        hits += len(told) == 1 and told[0][0] == t[at - 1]
    assert hits == 20
