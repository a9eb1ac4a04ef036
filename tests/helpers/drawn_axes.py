"""Figures as they are before they become SVG: made of a trace by hand, and what their axes hold."""

from typing import Any, cast

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from snarelab.identification.diagnosis import Trace
from snarelab.report.drawing import GREY, SHADE

TIME = np.arange(1281) / 64
"""20 s at 64 Hz: every time is exact in binary, and no line is thinned."""


def drawn(made: Any) -> Figure:
    return cast(Figure, made)


def trace(channel="tau.joint1", unit="N*m", **columns: Any):
    """Measured 1, model 1 and 1 unless said otherwise; a file name of its own."""
    given = {"time": TIME, "position": np.sin(TIME), "speed": np.cos(TIME)} | columns
    ones = np.ones(len(given["time"]))
    made = {name: given.get(name, ones) for name in ("measured", "before", "after")}
    return Trace(f"{channel}.csv", "train", channel, unit, given["time"], given["position"], given["speed"], **made)


def spikes(**heights):
    """A signal of TIME that is zero but for these heights, at times named by s<seconds>."""
    signal = np.zeros(len(TIME))
    for at, height in heights.items():
        signal[int(64 * float(at[1:]))] = height
    return signal


def lines(axes):
    """(colour, values, label) of the lines over time; level ones at zero are the axis."""
    found = [(to_hex(x.get_color()).upper(), np.asarray(x.get_ydata(), float), str(x.get_label())) for x in axes.lines]
    return [entry for entry in found if entry[0] != GREY]


def shaded(axes):
    """Start and end of the shaded windows."""
    boxes = [p for p in axes.patches if to_hex(p.get_facecolor()).upper() == SHADE]
    return [(p.get_x(), p.get_x() + p.get_width()) for p in boxes]
