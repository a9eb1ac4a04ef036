"""The report's pictures over time, and its bars: each takes a part of the diagnosis and returns SVG."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE, drawing, line, margins, svg
from ...report.time_axes import over_time
from ...report.words import percent, unit_words, words
from ..diagnosis import Array, Candidate, Location, Step, Trace

_WIDTH = 10.0


def residual_over_time(traces: Sequence[Trace], places: Sequence[Location]) -> bytes:
    """Residual of the model as it was, one strip a channel, with the windows of its location shaded."""
    with drawing():
        height = 0.9 + 1.35 * len(traces)
        figure = Figure(figsize=(_WIDTH, height))
        strips = figure.subplots(len(traces), sharex=True, squeeze=False)[:, 0]
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.3), hspace=0.45)
        for axes, trace in zip(strips, traces, strict=True):
            line(axes, trace.time, trace.measured - trace.before, BEFORE)
            over_time(axes, trace.recording)
            span = axes.get_xlim()
            windows = [window for place in places if place.channel == trace.channel for window in place.time_windows]
            for start, end in windows:
                axes.axvspan(start, end, color=SHADE, alpha=0.35, linewidth=0, zorder=0.5)
            axes.set_xlim(span)
            axes.axhline(0, color=GREY, linewidth=0.6)
            axes.set_title(f"{trace.channel}, {trace.recording}")
            axes.set_ylabel(f"residual [{unit_words(trace.unit)}]")
        strips[-1].set_xlabel("time [s]")
        figure.align_ylabels()
        return svg(figure)


def before_and_after(trace: Trace, changed: bool) -> bytes:
    """Measurement and model above, residual below; whole recording left, the stretch of most interest right.

    With ``changed`` the model appears before and after, and the stretch is where the two differ most; otherwise once,
    and the stretch is where it misses most.
    """
    with drawing():
        figure = Figure(figsize=(_WIDTH, 4.4))
        grid = figure.subplots(2, 2, gridspec_kw={"width_ratios": [2.1, 1], "height_ratios": [1.35, 1]})
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.5), hspace=0.22, wspace=0.16)
        after = trace.after if changed else trace.before
        start, end = _stretch(trace.time, trace.after - trace.before if changed else trace.measured - trace.before)
        inside = (trace.time >= start) & (trace.time <= end)
        for column, part in enumerate((np.ones(trace.time.size, bool), inside)):
            upper, lower = grid[0, column], grid[1, column]
            wide = 0.8 + 0.4 * column
            time, measured, before = trace.time[part], trace.measured[part], trace.before[part]
            line(upper, time, measured, MEASURED, wide, "measured")
            lower.axhline(0, color=GREY, linewidth=0.6)
            if changed:
                line(upper, time, before, BEFORE, wide, "model before")
                line(lower, time, measured - before, BEFORE, wide)
            line(upper, time, after[part], AFTER, wide, "model after" if changed else "model")
            line(lower, time, measured - after[part], AFTER, wide)
            for axes in (upper, lower):
                over_time(axes, trace.recording)
            upper.tick_params(labelbottom=False)
            lower.set_xlabel("time [s]")
            lower.set_xlim(upper.get_xlim())
        for axes in grid[:, 0]:
            axes.axvspan(start, end, color=SHADE, alpha=0.35, linewidth=0, zorder=0.5)
        unit = unit_words(trace.unit)
        grid[0, 0].set_ylabel(f"{trace.channel} [{unit}]")
        grid[1, 0].set_ylabel(f"residual [{unit}]")
        grid[0, 1].set_title("the shaded stretch")
        figure.align_ylabels(grid[:, 0])
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="upper left", ncols=3, bbox_to_anchor=(0.06, 1.0))
        return svg(figure)


def steps(rows: Sequence[Step]) -> bytes:
    """Relative misfit of each step, on the training recordings and the held-out one."""
    with drawing():
        labels = [row.label for row in rows]
        figure, axes = _bars(labels, 0.42, 8.0)
        places = np.arange(len(rows))
        for offset, colour, label, values in (
            (-0.19, GREY, "training", [100 * row.train for row in rows]),
            (0.19, AFTER, "held-out", [100 * row.holdout for row in rows]),
        ):
            axes.barh(places + offset, values, 0.36, color=colour, label=label)
            _numbers(axes, places + offset, values)
        axes.set_xlabel("relative misfit [%]")
        handles, names = axes.get_legend_handles_labels()
        figure.legend(handles, names, loc="upper right", ncols=2)
        return svg(figure)


def candidates(rows: Sequence[Candidate]) -> bytes:
    """What each candidate explains by itself on top of the baseline; those named stand out in colour."""
    with drawing():
        labels = [f"{words(row.name)}, {row.at}" for row in rows]
        figure, axes = _bars(labels, 0.26, 8.0)
        places = np.arange(len(rows))
        values = [100 * row.explained for row in rows]
        for named, colour, label in ((True, BEFORE, "named"), (False, GREY, "not named")):
            chosen = [i for i, row in enumerate(rows) if row.named == named]
            axes.barh(places[chosen], [values[i] for i in chosen], 0.7, color=colour, label=label)
        _numbers(axes, places, values)
        for label, row in zip(axes.get_yticklabels(), rows, strict=True):
            label.set_fontweight("bold" if row.named else "normal")
        axes.set_xlabel("share of the baseline's residual energy explained by itself [%]")
        handles, names = axes.get_legend_handles_labels()
        figure.legend(handles, names, loc="upper right", ncols=2)
        return svg(figure)


def _stretch(time: Array, signal: Array, share: float = 0.06) -> tuple[float, float]:
    """The stretch of so much of the recording that holds most of the signal's energy, as start and end [s]."""
    energy = np.cumsum(np.nan_to_num(signal) ** 2)
    length = max(share * (time[-1] - time[0]), 60 * float(np.median(np.diff(time))))
    ends = np.searchsorted(time, time + length, side="right") - 1
    whole = time + length <= time[-1]
    held = np.where(whole, energy[ends] - energy, -1.0)
    start = float(time[int(np.argmax(held))]) if whole.any() else float(time[0])
    return start, min(start + length, float(time[-1]))


def _bars(labels: Sequence[str], each: float, width: float) -> tuple[Figure, Axes]:
    """Axes for horizontal bars, first on top, with as much room at the left as the longest label needs."""
    shown = [label if len(label) <= 52 else f"{label[:51]}…" for label in labels]
    height = 0.85 + each * len(shown)
    figure = Figure(figsize=(width, height))
    axes = figure.subplots()
    figure.subplots_adjust(**margins(figure, 0.3 + 0.066 * max(map(len, shown)), 0.6, 0.5, 0.35))
    axes.set_yticks(np.arange(len(shown)), shown)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    return figure, axes


def _numbers(axes: Axes, places: Array | np.ndarray, values: Sequence[float]) -> None:
    for place, value in zip(places, values, strict=True):
        if np.isfinite(value):
            axes.annotate(
                percent(value / 100, 3), (value, place), (3, 0), textcoords="offset points", va="center", fontsize=7.5
            )
