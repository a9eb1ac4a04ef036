"""Residual against speed and position: where a friction law, a spring or a ripple shows its shape."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...report.drawing import AFTER, BEFORE, GREY, drawing, margins, svg
from ...report.words import unit_words, words
from ..diagnosis import Array, FrictionCurve, Trace

_BINS = 40
_FEWEST = 8
_POINTS = 2500
_COORDINATE_UNIT = {"N*m": "rad", "N": "m"}


def residual_curves(traces: Sequence[Trace], changed: bool) -> bytes | None:
    """One channel's residual against speed and position, all traces together; None where neither moved or was known."""
    residuals = [("before" if changed else "model", BEFORE if changed else AFTER, _join(traces, "before"))]
    if changed:
        residuals.append(("after", AFTER, _join(traces, "after")))
    unit = _COORDINATE_UNIT.get(traces[0].unit, "")
    panels = [
        ("speed", f"{unit}/s" if unit else "", np.concatenate([t.speed for t in traces])),
        ("position", unit, np.concatenate([t.position for t in traces])),
    ]
    panels = [panel for panel in panels if _moves(panel[2])]
    if not panels:
        return None
    with drawing():
        figure = Figure(figsize=(10.0 if len(panels) == 2 else 5.4, 3.4))
        row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.4), wspace=0.06)
        for axes, (name, coordinate_unit, coordinate) in zip(row, panels, strict=True):
            axes.axhline(0, color=GREY, linewidth=0.6)
            for label, colour, residual in residuals:
                _curve(axes, coordinate, residual, colour, label)
            axes.set_xlabel(f"{name} [{coordinate_unit}]" if coordinate_unit else name)
        row[0].set_ylim(_limits(np.concatenate([residual for _, _, residual in residuals])))
        row[0].set_ylabel(f"{traces[0].channel} residual [{unit_words(traces[0].unit)}]")
        handles, names = row[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="upper left", ncols=2, bbox_to_anchor=(0.06, 1.0))
        return svg(figure)


def friction_over_speed(curve: FrictionCurve) -> bytes:
    """Friction of one joint that depends on speed alone, with a band of two standard deviations either side."""
    unit = _COORDINATE_UNIT.get(curve.unit, "")
    with drawing():
        figure = Figure(figsize=(5.4, 2.8))
        axes = figure.subplots()
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.15))
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.axvline(0, color=GREY, linewidth=0.6)
        low, high = curve.value - 2 * curve.std, curve.value + 2 * curve.std
        axes.fill_between(curve.speed, low, high, color=AFTER, alpha=0.25, linewidth=0)
        axes.plot(curve.speed, curve.value, color=AFTER, linewidth=1.6)
        axes.set_xlabel(f"speed of {curve.at} [{unit}/s]" if unit else f"speed of {curve.at}")
        axes.set_ylabel(f"friction [{unit_words(curve.unit)}]")
        return svg(figure)


def friction_words(curve: FrictionCurve) -> str:
    """What stands in the picture of a friction curve."""
    laws = ", ".join(words(name) for name in curve.effects)
    return f"Friction of {curve.at} over its speed, of the laws there that depend on speed alone: {laws}."


def binned(coordinate: Array, residual: Array, bins: int = _BINS) -> tuple[Array, Array, Array]:
    """Bin centres, mean and standard deviation of the residual in bins of equal width, each (n_bins,).

    Where the coordinate changes sign zero is an edge, so that a jump there is not smeared. Bins with fewer than eight
    samples are NaN.
    """
    low, high = float(coordinate.min()), float(coordinate.max())
    width = (high - low) / bins
    first = np.floor(low / width) if low < 0 < high else low / width
    edges = width * (first + np.arange(bins + 2))
    index = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, bins)
    count = np.bincount(index, minlength=bins + 1)
    enough = count >= _FEWEST
    count = np.where(enough, count, 1)
    mean = np.bincount(index, residual, bins + 1) / count
    spread = np.bincount(index, (residual - mean[index]) ** 2, bins + 1) / count
    centres = 0.5 * (edges[1:] + edges[:-1])
    return centres, np.where(enough, mean, np.nan), np.where(enough, np.sqrt(spread), np.nan)


def _curve(axes: Axes, coordinate: Array, residual: Array, colour: str, label: str) -> None:
    finite = np.isfinite(coordinate) & np.isfinite(residual)
    coordinate, residual = coordinate[finite], residual[finite]
    if not _moves(coordinate):
        return
    some = np.linspace(0, coordinate.size - 1, min(_POINTS, coordinate.size)).astype(int)
    axes.plot(
        coordinate[some],
        residual[some],
        ".",
        color=colour,
        markersize=2.2,
        markeredgewidth=0,
        alpha=0.25,
        rasterized=True,
        zorder=1.5,
    )
    centre, mean, spread = binned(coordinate, residual)
    axes.fill_between(centre, mean - spread, mean + spread, color=colour, alpha=0.18, linewidth=0, zorder=1.8)
    axes.plot(centre, mean, color=colour, linewidth=1.8, label=label, zorder=3)


def _join(traces: Sequence[Trace], model: str) -> Array:
    return np.concatenate([t.measured - getattr(t, model) for t in traces])


def _moves(coordinate: Array) -> bool:
    finite = coordinate[np.isfinite(coordinate)]
    return finite.size >= _FEWEST and float(np.ptp(finite)) > 1e-9 * max(1.0, float(np.abs(finite).max()))


def _limits(residual: Array) -> tuple[float, float]:
    """Limits that leave out the outermost thousandth of the points on either side."""
    finite = residual[np.isfinite(residual)]
    if finite.size == 0:
        return -1.0, 1.0
    low, high = np.quantile(finite, [0.001, 0.999])
    margin = 0.1 * float(high - low) or 1.0
    return float(low) - margin, float(high) + margin
