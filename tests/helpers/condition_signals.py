"""Recordings of known motion for the tests of conditioning."""

import numpy as np
import xarray as xr

from snarelab.recordings.condition import Motion

RATE = 200.0
BAND = 20.0


def recording(time, q, tau=None, joints=("joint1",), **attrs):
    """A dataset as `read_recording` gives it; q, tau of shape (n_samples,) or (n_samples, n_joints)."""
    q = np.asarray(q, float).reshape(len(time), -1)
    tau = np.zeros_like(q) if tau is None else np.asarray(tau, float).reshape(len(time), -1)
    variables = {f"q.{j}": ("time", q[:, k]) for k, j in enumerate(joints)}
    variables |= {f"tau.{j}": ("time", tau[:, k]) for k, j in enumerate(joints)}
    return xr.Dataset(variables, {"time": np.asarray(time, float)}, attrs={"path": "run.csv", **attrs})


def clock(seconds=10.0, rate=RATE):
    return np.arange(round(seconds * rate)) / rate


def sine(time, frequency, phase=0.4):
    """Position, rate and acceleration."""
    w = 2 * np.pi * frequency
    return np.sin(w * time + phase), w * np.cos(w * time + phase), -(w**2) * np.sin(w * time + phase)


def noted(motion: Motion, *words):
    assert any(all(w in note for w in words) for note in motion.notes), motion.notes
