"""Evenness and gaps of a recording's sampling."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from .signals import joint_signals

#: A step longer than this many median periods is a gap.
GAP = 1.5
#: Largest relative deviation from the median period that still counts as uniform.
UNIFORM = 0.01


@dataclass(frozen=True)
class Sampling:
    """The time base of a recording.

    Parameters
    ----------
    period : float
        Median step [s].
    jitter : float
        Largest deviation from the median step, relative to it, over all steps that are not gaps.
    gaps : tuple of (start, stop)
        Last time before and first time after each stretch [s] without samples (a step over 1.5 periods),
        or with all joint signals missing.
    uniform : bool
        True when there is no gap and the jitter is at most 1 %.
    """

    period: float
    jitter: float
    gaps: tuple[tuple[float, float], ...]
    uniform: bool


def sampling(dataset: xr.Dataset) -> Sampling:
    """Describe the time base of a recording of at least 2 samples.

    Steps are those of ``time``; a recording without joint signals is judged by all its signals.
    """
    time = dataset["time"].to_numpy()
    steps = np.diff(time)
    period = float(np.median(steps))
    regular = steps <= GAP * period
    names = joint_signals(map(str, dataset.data_vars)) or list(dataset.data_vars)
    missing = np.all([np.isnan(dataset.variables[name].to_numpy()) for name in names], axis=0)
    jitter = float(np.max(np.abs(steps[regular] - period), initial=0.0) / period)
    ends = np.unique(np.concatenate([[0], np.flatnonzero(~missing), [len(time) - 1]]))
    wide = (np.diff(time[ends]) > GAP * period) | (np.diff(ends) > 1) | missing[ends[:-1]] | missing[ends[1:]]
    gaps = tuple((float(time[a]), float(time[b])) for a, b in zip(ends[:-1][wide], ends[1:][wide], strict=True))
    return Sampling(period, jitter, gaps, uniform=not gaps and jitter <= UNIFORM)
