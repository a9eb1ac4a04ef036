"""Residual against speed and position: where a friction law, a spring or a ripple shows its shape."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...report.bins import FEWEST, binned
from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, drawing, margins, svg
from ...report.words import unit_words, words
from ..diagnosis import Array, FrictionCurve, Trace

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
    """Friction of one joint that depends on speed alone, with a band of two standard deviations either side; the laws
    that add up to it; and what was measured."""
    unit = _COORDINATE_UNIT.get(curve.unit, "")
    with drawing():
        rows = 1 + (len(curve.parts) + 1) // 2
        figure = Figure(figsize=(5.4, 2.8 + 0.2 * rows))
        axes = figure.subplots()
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.15 + 0.2 * rows))
        axes.axhline(0, color=GREY, linewidth=0.6)
        axes.axvline(0, color=GREY, linewidth=0.6)
        low, high = curve.value - 2 * curve.std, curve.value + 2 * curve.std
        axes.fill_between(curve.speed, low, high, color=AFTER, alpha=0.25, linewidth=0)
        axes.plot(curve.speed, curve.value, color=AFTER, linewidth=1.6, label="friction")
        if len(curve.parts) > 1:
            for name, part, dashes in zip(curve.effects, curve.parts, cycle(("--", ":", "-.")), strict=False):
                axes.plot(curve.speed, part, dashes, color=GREY, linewidth=1.1, label=words(name))
        if curve.measured is not None:
            at, mean, spread = curve.measured
            axes.errorbar(
                at, mean, spread, fmt=".", color=MEASURED, markersize=4, linewidth=0.7, zorder=1.5, label="measured"
            )
        figure.legend(loc="upper left", ncols=2, bbox_to_anchor=(0.06, 1.0))
        axes.set_xlabel(f"speed of {curve.at} [{unit}/s]" if unit else f"speed of {curve.at}")
        axes.set_ylabel(f"friction [{unit_words(curve.unit)}]")
        return svg(figure)


def friction_words(curve: FrictionCurve) -> str:
    """What stands in the picture of a friction curve."""
    laws = ", ".join(words(name) for name in curve.effects)
    said = f"Friction of {curve.at} over its speed, of the laws there that depend on speed alone: {laws}."
    if curve.measured is None:
        return said
    kind = "force" if curve.unit == "N" else "torque"
    return f"{said} Points: the measured {kind} less everything else in the model, mean and standard deviation."


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
    return finite.size >= FEWEST and float(np.ptp(finite)) > 1e-9 * max(1.0, float(np.abs(finite).max()))


def _limits(residual: Array) -> tuple[float, float]:
    """Limits that leave out the outermost thousandth of the points on either side."""
    finite = residual[np.isfinite(residual)]
    if finite.size == 0:
        return -1.0, 1.0
    low, high = np.quantile(finite, [0.001, 0.999])
    margin = 0.1 * float(high - low) or 1.0
    return float(low) - margin, float(high) + margin
