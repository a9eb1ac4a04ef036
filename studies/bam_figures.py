"""Pictures of the servo study: positions on the held-out gain, and what each law explains."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ..report.drawing import AFTER, BEFORE, GREY, MEASURED, drawing, line, margins, svg
from ..report.time_axes import over_time
from .bam_naming import LawTrial, Values
from .bam_servo import ServoRun, simulate


def positions(runs: Sequence[ServoRun], before: Values, after: Values) -> bytes:
    """Position of every run: measured, and as two models predict it in closed loop."""
    with drawing():
        figure = Figure(figsize=(10.0, 6.2))
        panels = figure.subplots(2, 2).ravel()
        figure.subplots_adjust(**margins(figure, 0.75, 0.15, 0.5, 0.5), hspace=0.3, wspace=0.16)
        for axes, run in zip(panels, runs, strict=True):
            line(axes, run.time, run.position, MEASURED, 1.2, "measured")
            line(axes, run.time, simulate(run, before), BEFORE, 1.0, "Coulomb and viscous")
            line(axes, run.time, simulate(run, after), AFTER, 1.0, "with what was named")
            over_time(axes, run.name)
            axes.set_title(run.trajectory.replace("_", " "))
        for axes in panels[2:]:
            axes.set_xlabel("time [s]")
        for axes in panels[::2]:
            axes.set_ylabel("position [rad]")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="upper left", ncols=3)
        return svg(figure)


def explained(tried: Sequence[LawTrial]) -> bytes:
    """Share of the squared position error that each law explains, fitted to all gains and predicted for each."""
    with drawing():
        figure = Figure(figsize=(8.0, 0.9 + 0.42 * len(tried)))
        axes = figure.subplots()
        figure.subplots_adjust(**margins(figure, 2.2, 0.3, 0.5, 0.35))
        places = np.arange(len(tried))
        axes.barh(places, [100 * t.explained for t in tried], 0.6, color=GREY, label="fitted to all gains")
        for place, t in zip(places, tried, strict=True):
            forecast = [100 * x for x in t.forecast.values()]
            axes.plot(forecast, [place] * len(forecast), "o", color=AFTER, markersize=5)
        axes.plot([], [], "o", color=AFTER, markersize=5, label="a gain predicted from the others")
        axes.set_yticks(places, [t.name.replace("_", " ") for t in tried])
        axes.invert_yaxis()
        axes.axvline(0, color=GREY, linewidth=0.6)
        axes.set_xlabel("share of the squared position error explained [%]")
        figure.legend(loc="upper right", ncols=2)
        return svg(figure)
