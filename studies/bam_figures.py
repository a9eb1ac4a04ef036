"""Pictures of the servo study: positions on the held-out gain, and what each law explains."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from ..identification.decision.selection import Trial
from ..models.servo_loop import simulate
from ..report.drawing import AFTER, BEFORE, GREY, MEASURED, drawing, line, margins, svg
from ..report.time_axes import over_time
from ..report.words import words
from .bam_recordings import BamRun

Values = Mapping[str, float]


def positions(runs: Sequence[BamRun], before: Values, after: Values) -> bytes:
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


def explained(trials: Sequence[Trial], named: Sequence[str]) -> bytes:
    """Share of the whitened residual that each law by itself explains; those that were named are told apart."""
    with drawing():
        figure = Figure(figsize=(8.0, 0.9 + 0.42 * len(trials)))
        axes = figure.subplots()
        figure.subplots_adjust(**margins(figure, 2.2, 0.3, 0.5, 0.15))
        places = np.arange(len(trials))
        colours = [AFTER if t.placed.effect.name in named else GREY for t in trials]
        axes.barh(places, [100 * t.explained for t in trials], 0.6, color=colours)
        axes.set_yticks(places, [words(t.placed.effect.name) for t in trials])
        axes.invert_yaxis()
        axes.set_xlabel("share of the whitened residual explained [%]")
        return svg(figure)
