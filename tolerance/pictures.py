"""Pictures of a tolerance study: probability maps, envelope bars, sensitivity bars, and how the boundary narrowed."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..report.drawing import AFTER, BEFORE, GREY, SHADE, drawing, svg
from .boundary import UNDECIDED, Boundary
from .study import Study
from .summary import Interval, nominal_point, to_unit

_GRID = 61


def probability_maps(study: Study, boundary: Boundary, table: pd.DataFrame) -> bytes:
    """Probability of success over each pair of the first four varied axes, the others at nominal; cases as dots."""
    pairs = list(combinations(list(study.ranges)[:4], 2))
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    with drawing():
        figure = Figure(figsize=(3.4 * columns, 3.0 * rows), layout="constrained")
        for k, (x, y) in enumerate(pairs):
            axes = figure.add_subplot(rows, columns, k + 1)
            gx, gy = (np.linspace(*study.ranges[name], _GRID) for name in (x, y))
            points = np.tile(nominal_point(study), (_GRID * _GRID, 1))
            names = list(study.ranges)
            points[:, names.index(x)], points[:, names.index(y)] = (g.ravel() for g in np.meshgrid(gx, gy))
            p = boundary.probability(to_unit(study, points)).reshape(_GRID, _GRID)
            axes.contourf(gx, gy, p, levels=[0, *UNDECIDED, 1], colors=["#F3D9C8", "#E9E9E9", "#CFE5F3"])
            axes.contour(gx, gy, p, levels=[0.5], colors=[AFTER], linewidths=1.2)
            won = table["margin"].to_numpy(float) > 0
            axes.plot(table[x][won], table[y][won], ".", color=AFTER, markersize=2)
            axes.plot(table[x][~won], table[y][~won], "x", color=BEFORE, markersize=2.5, markeredgewidth=0.5)
            axes.set(xlabel=_label(study, x), ylabel=_label(study, y))
            axes.locator_params(axis="x", nbins=5)
            axes.grid(False)
        return svg(figure)


def envelope_bars(study: Study, ends: Mapping[str, tuple[Interval, Interval]]) -> bytes:
    """How far each axis may go, as a share of its range, with the interval of each end."""
    with drawing():
        figure = Figure(figsize=(8.0, 0.45 * len(ends) + 0.9), layout="constrained")
        axes = figure.add_subplot()
        for row, (name, (down, up)) in enumerate(ends.items()):
            scale = max(map(abs, study.ranges[name]))
            axes.barh(row, (up.value - down.value) / scale, left=down.value / scale, height=0.5, color=SHADE)
            for end in (down, up):
                axes.plot([end.low / scale, end.high / scale], [row, row], color="#1C2329", linewidth=1.5)
        axes.set_yticks(
            range(len(ends)),
            [f"{n}: {d.value:.3g} to {u.value:.3g} {_unit(study, n)}".rstrip() for n, (d, u) in ends.items()],
        )
        axes.invert_yaxis()
        axes.set(xlim=(-1.05, 1.05), xlabel="share of the largest value that was searched")
        return svg(figure)


def sensitivity_bars(indices: pd.DataFrame) -> bytes:
    """Total and first-order Sobol indices with their intervals, largest first."""
    ordered = indices.sort_values("total", ascending=False)
    with drawing():
        figure = Figure(figsize=(8.0, 0.5 * len(ordered) + 1.2), layout="constrained")
        axes, rows = figure.add_subplot(), np.arange(len(ordered))
        for name, shift, colour in (("total", -0.18, AFTER), ("first", 0.18, GREY)):
            value = ordered[name].to_numpy(float)
            low, high = ordered[f"{name}_low"].to_numpy(float), ordered[f"{name}_high"].to_numpy(float)
            spread = np.maximum([value - low, high - value], 0.0)
            label = "with its interactions" if name == "total" else "alone"
            axes.barh(rows + shift, value, height=0.32, color=colour, xerr=spread, label=label)
        axes.set_yticks(rows, list(ordered.index))
        axes.invert_yaxis()
        axes.set(xlabel="share of the variance of success (Sobol index)")
        figure.legend(loc="outside upper right", ncols=2)  # above the bars: each may fill the width
        return svg(figure)


def width_curve(counts: np.ndarray, widths: np.ndarray, wanted: float) -> bytes:
    """Undecided share of the range against the number of cases."""
    with drawing():
        figure = Figure(figsize=(8.0, 2.6), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(counts, 100 * widths, "o-", color=AFTER, markersize=3)
        axes.axhline(100 * wanted, color=BEFORE, linewidth=0.8)
        axes.set(xlabel="cases", ylabel="undecided [% of the range]", ylim=(0, None))
        return svg(figure)


def _label(study: Study, name: str) -> str:
    unit = _unit(study, name)
    return f"{name} [{unit}]" if unit else name


def _unit(study: Study, name: str) -> str:
    return study.capture.axis(name).unit.removeprefix("1")
