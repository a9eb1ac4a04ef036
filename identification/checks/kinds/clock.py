"""Time stamps that are not when the samples were taken: positions are smooth over their number, and not over time."""

from pathlib import Path

import numpy as np
import xarray as xr

from ..case import CheckCase
from ..finding import CheckFinding, Kind

UNEVEN = 0.05
"""Share of the period by which stamps must be off an even clock to be doubted."""

SMOOTHER = 9.0
"""Ratio of mean squared errors of predicted steps of position from which on an even clock is the one."""

ABOUT = 25
"""Samples to either side over which a joint's speed is taken."""


def find(case: CheckCase) -> list[CheckFinding]:
    """Recordings whose stamps jitter while the motion does not."""
    return [finding for dataset in case.datasets if (finding := _clock(case, dataset)) is not None]


def _clock(case: CheckCase, dataset: xr.Dataset) -> CheckFinding | None:
    t = np.asarray(dataset["time"].values, float)
    steps = np.diff(t)
    period = float(np.median(steps))
    mean = (t[-1] - t[0]) / (len(t) - 1)
    even = t[0] + mean * np.arange(len(t))
    off = float(np.std(t - even) / mean)
    if len(t) < 100 or float(np.mean(np.abs(steps - period) > UNEVEN * period)) < 0.02:
        return None
    ratios = []
    for joint in case.joints:
        x = np.asarray(dataset[f"q.{joint}"].values, float) if f"q.{joint}" in dataset else np.array([np.nan])
        if np.isfinite(x).all() and np.ptp(x) > 0:
            stamped, counted = _missed(t, x), _missed(even, x)
            if counted > 0:
                ratios.append(stamped / counted)
    if not ratios or np.median(ratios) < SMOOTHER:
        return None
    name = Path(str(dataset.attrs["path"])).name
    return CheckFinding(
        "clock",
        "time",
        0.99,
        f"{name}: the time stamps are not when samples were taken: they are {off:.2g} periods off an even clock, "
        f"and over an even one steps of position are predicted {np.sqrt(np.median(ratios)):.2g} times better",
        f'"time" = {{ rate = {1 / mean:.9g} }}',
    )


def _missed(t: np.ndarray, x: np.ndarray) -> float:
    """Mean square of what steps of a position differ from its mean speed about them times how long they took."""
    reach = min(ABOUT, len(t) // 4)
    whole = slice(reach, len(t) - 1 - reach)
    speed = (x[2 * reach + 1 :] - x[: -2 * reach - 1]) / (t[2 * reach + 1 :] - t[: -2 * reach - 1])
    return float(np.mean((np.diff(x)[whole] - speed * np.diff(t)[whole]) ** 2))


KIND = Kind("clock", "time stamps are not when samples were taken", find=find, early=True)
