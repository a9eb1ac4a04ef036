"""Two masses on springs, joined by a spring: the exact solution, observed orders, and panels of error curves.

The system is that of ``snarelab.cosim.participants.oscillator`` with its own values: 1 kg on 10 N/m each, joined by
3 N/m. Its exact solution is the matrix exponential.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter
from scipy.linalg import expm

from snarelab.cosim.master import HoldName
from snarelab.report.drawing import drawing, svg

CONNECTIONS = (("right.force", "left.force"), ("left.x", "right.x_left"), ("left.v", "right.v_left"))
SECONDS = 10.0
_RATES = np.array([[0, 1, 0, 0], [-13, 0, 3, 0], [0, 0, 0, 1], [3, 0, -13, 0]], dtype=float)
_COLOURS: Mapping[HoldName, str] = {
    "constant": "#000000", "midpoint": "#D55E00", "linear": "#0072B2", "quadratic": "#009E73",
}  # fmt: skip
"""Okabe & Ito (2008)."""


def exact(times: np.ndarray, start: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    """Positions of both masses [m], (n_samples, 2), from a start x, v [m, m/s] of the left and of the right one."""
    values, vectors = np.linalg.eig(_RATES)
    states = (np.exp(np.outer(times, values)) * np.linalg.solve(vectors, start)) @ vectors.T
    assert np.allclose(states[-1], expm(_RATES * times[-1]) @ start, atol=1e-12)
    return states.real[:, [0, 2]]


def largest_error(recording: xr.Dataset, start: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> float:
    """Largest position error [m] of either mass in a run."""
    found = np.column_stack([recording[f"{side}.x [m]"].to_numpy() for side in ("left", "right")])
    return float(np.abs(found - exact(recording["time"].to_numpy(), start)).max())


def slopes(x: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Observed orders between neighbours."""
    pairs = zip(pairwise(x), pairwise(errors), strict=True)
    return [float(np.log(e1 / e2) / np.log(h1 / h2)) for (h1, h2), (e1, e2) in pairs]


Panel = tuple[str, str, Sequence[float], Mapping[HoldName, Sequence[float]]]
"""Title, what lies along x, its values, errors [m] by hold."""


def error_figure(panels: Sequence[Panel], slope: str = "order") -> bytes:
    """Errors over what lies along x, a panel beside the other, as SVG; labels tell the last slope."""
    with drawing():
        figure, axes = plt.subplots(1, len(panels), figsize=(8.4, 3.2), sharey=True, layout="constrained")
        for panel, (title, along, x, curves) in zip(axes, panels, strict=True):
            for hold, errors in curves.items():
                label = f"{hold}, {slope} {slopes(x, errors)[-1]:.1f}"
                panel.loglog(x, errors, color=_COLOURS[hold], marker="o", markersize=3, label=label)
            panel.set(title=title, xlabel=along)
            panel.legend(loc="lower right", fontsize=7)
            plain_ticks(panel, x)
        axes[0].set_ylabel("largest position error [m]")
        axes[0].set_ylim(bottom=0.03 * min(min(errors) for *_, curves in panels for errors in curves.values()))
        picture = svg(figure)
        plt.close(figure)
    return picture


def plain_ticks(panel: Axes, at: Sequence[float]) -> None:
    """Numbers, not powers in mathematical text, which the report's style leaves as it is typed."""
    panel.xaxis.set_major_locator(FixedLocator(list(at)))
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
