"""A position that jumps between two samples, as where two runs were joined, or an encoder lost counts."""

from pathlib import Path

import numpy as np
import xarray as xr
from scipy.ndimage import median_filter

from ..case import CheckCase
from ..finding import CheckFinding, Kind

TIMES = 12.0
"""A step this many times what positions do about it is none that a drive makes: joints have inertia."""

COUNTS = 25.0
"""Steps of the encoder up to which a jump is noise or its rounding."""

ABOUT = 10
"""Steps to either side that a step is held against."""


def find(case: CheckCase) -> list[CheckFinding]:
    """Jumps of each recording, by joint: where, how far, and that they stay."""
    found = []
    for dataset in case.datasets:
        for joint in case.joints:
            name = f"q.{joint}"
            if name in dataset:
                found += [_finding(case, dataset, name, *jump) for jump in jumps(dataset, name)[:3]]
    return found


def jumps(dataset: xr.Dataset, name: str) -> list[tuple[float, float]]:
    """(time [s], how far) of every step of a position that its neighbours do not predict, largest first.

    What is held against the steps about it is the step less what they move meanwhile; where the stamp may be off and
    not the position, less what they move. A spike that comes back at once is no jump.
    """
    x, t = np.asarray(dataset[name].values, float), np.asarray(dataset["time"].values, float)
    good = np.isfinite(x)
    x, t = x[good], t[good]
    if len(x) < 8 * ABOUT:
        return []
    step, wait = np.diff(x), np.diff(t)
    period = float(np.median(wait))
    speed = step / wait
    usual = median_filter(speed, 2 * ABOUT + 1, mode="nearest")
    unexpected = np.abs(speed - usual) * np.minimum(wait, 1.5 * period)
    # Samples may be even, and their stamps not: then the steps themselves are smooth.
    unexpected = np.minimum(unexpected, np.abs(step - median_filter(step, 2 * ABOUT + 1, mode="nearest")))
    about = _largest_about(np.abs(speed - usual) * period)
    quantum = np.unique(np.round(np.abs(step[step != 0]), 12))
    count = float(quantum[0]) if len(quantum) else 0.0
    noise = float(np.median(np.abs(np.diff(step)))) + count
    bar = np.maximum(TIMES * about, COUNTS * noise)
    bar = np.maximum(bar, TIMES * np.median(np.abs(speed)) * period)
    found = []
    for i in np.flatnonzero((unexpected > bar) & (wait < 1.5 * period)):
        before, after = x[max(0, i - 3) : i + 1], x[i + 1 : i + 5]
        if len(after) < 4 or abs(float(np.median(after) - np.median(before))) < 0.5 * abs(step[i]):
            continue
        found.append((float(t[i]), float(step[i])))
    return sorted(found, key=lambda jump: -abs(jump[1]))


def _largest_about(size: np.ndarray) -> np.ndarray:
    """The largest of the values about each, itself and its next neighbours left out."""
    n = len(size)
    padded = np.pad(size, ABOUT, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * ABOUT + 1)[:n]
    return np.max(np.delete(windows, [ABOUT - 1, ABOUT, ABOUT + 1], axis=1), axis=1)


def _finding(case: CheckCase, dataset: xr.Dataset, name: str, at: float, far: float) -> CheckFinding:
    joint = case.tree.joints[case.joints.index(name.partition(".")[2])]
    unit = "m" if joint.kind == "prismatic" else "rad"
    later = np.asarray(dataset["time"].values, float)
    after = float(later[later > at][0])
    return CheckFinding(
        "jump",
        name,
        0.99,
        f"{Path(dataset.attrs['path']).name}: {name} jumps by {far:+.3g} {unit} between {at:.6g} and {after:.6g} s",
        f"breaks = [{0.5 * (at + after):.9g}]",
    )


KIND = Kind("jump", "a position jumps between two samples", find=find, early=True)
