"""Figures of a capture to the latch, the program's states marked in each."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ...models.docking.parameters import PRELOAD_WINDOW, DockingParameters
from ...models.inertia import Array
from ...report.drawing import AFTER, BEFORE, GREY, MEASURED, SHADE, drawing, line, svg
from ..page import Picture
from .axes import panels, plain
from .docked import DockingRun, energies, mean_wrist

_THIRD = "#009E73"


def marked(axes: Axes, d: DockingRun, named: bool = True) -> None:
    """Shade every other state of the program, and name those that there is room for."""
    span = d.times[-1] - d.times[0]
    for k, (state, begin, end) in enumerate(d.whole.phases):
        if k % 2:
            axes.axvspan(begin, end, color=GREY, alpha=0.15, linewidth=0)
        if named and end - begin > 0.012 * span:
            axes.text(
                0.5 * (begin + end), 0.98, state, transform=axes.get_xaxis_transform(), rotation=90, ha="center",
                va="top", fontsize=6.5,
            )  # fmt: skip


def pictures(d: DockingRun, p: DockingParameters) -> list[Picture]:
    """All of them."""
    return [_way(d, p), _forces(d), _flanks(d), _motion(d), _ledger(d)]


def _way(d: DockingRun, p: DockingParameters) -> Picture:
    with drawing():
        figure, axes = panels(3, 5.6)
        line(axes[0], d.times, 1e3 * d.travel, AFTER, 1.4, "travel of the carriage")
        for ball, colour in enumerate((AFTER, BEFORE, _THIRD)):
            line(axes[1], d.times, -1e3 * d.off[:, ball, 0], colour, 1.2, f"ball {ball + 1}")
            line(axes[2], d.times, 1e3 * d.off[:, ball, 1], colour, 1.2, f"ball {ball + 1}")
        axes[2].axhspan(-1e3 * p.half_width, 1e3 * p.half_width, color=SHADE, alpha=0.25, linewidth=0)
        for panel, label in zip(axes, ("travel [mm]", "gap [mm]", "across the groove [mm]"), strict=True):
            panel.set(ylabel=label)
            marked(panel, d, panel is axes[0])
            panel.legend(loc="lower left", fontsize=7.5)
        text = "Carriage, gap of each ball, and where it is across its groove; shaded there: the groove's mouth."
        return Picture(svg(figure), "Travel, gap and misalignment over time", text)


def _forces(d: DockingRun) -> Picture:
    with drawing():
        figure, axes = panels(3, 5.6)
        line(axes[0], d.times, 1e-3 * d.motor, AFTER, 1.2, "carriage's motor")
        axes[0].axhspan(*(1e-3 * x for x in PRELOAD_WINDOW), color=SHADE, alpha=0.35, linewidth=0)
        line(axes[1], d.times, 1e-3 * d.tension, BEFORE, 1.2, "a cable on its ring, largest")
        middles, wrist = mean_wrist(d)
        line(axes[2], middles, wrist, MEASURED, 1.0, "docking and cables together")
        for panel, label in zip(axes, ("force [kN]", "force [kN]", "wrist [N]"), strict=True):
            panel.set(ylabel=label)
            marked(panel, d, panel is axes[0])
            panel.legend(loc="center left", fontsize=7.5)
        text = (
            "Force of the carriage's motor with the window of published peaks; the largest force of a cable; and what "
            "the arm feels, averaged over 10 ms: the preload is internal and does not load it."
        )
        return Picture(svg(figure), "Forces over time", text)


def _flanks(d: DockingRun) -> Picture:
    with drawing():
        figure, axes = plain(3.0)
        for k, colour in enumerate((AFTER, BEFORE, _THIRD)):
            for side, style in ((0, "-"), (1, "--")):
                line(axes, d.times, d.normal[:, 2 * k + side], colour, 1.1, f"flank {2 * k + side + 1}")
                drawn: Any = axes.lines[-1]
                drawn.set_linestyle(style)
        axes.set(xlabel="time [s]", ylabel="normal force [N]")
        axes.legend(ncols=3, loc="center left", fontsize=7.5)
        marked(axes, d)
        return Picture(svg(figure), "Normal forces over time", "Normal forces of the six flanks.")


def _motion(d: DockingRun) -> Picture:
    with drawing():
        figure, axes = panels(2, 4.0)
        for panel, frame, name in ((axes[0], d.capture.base, "base"), (axes[1], d.capture.pin, "pin's foot")):
            for axis, colour in enumerate((MEASURED, BEFORE, AFTER)):
                line(panel, d.times, 1e3 * (frame[:, 0, axis] - frame[0, 0, axis]), colour, 1.2, "xyz"[axis])
            panel.set(ylabel=f"{name} [mm]")
            marked(panel, d, panel is axes[0])
        axes[0].legend(loc="lower left")
        return Picture(svg(figure), "Motion over time", "How far base and target have moved, in the world.")


def _ledger(d: DockingRun) -> Picture:
    ledger = energies(d)
    colours = (
        MEASURED,
        BEFORE,
        SHADE,
        "#009E73",
        AFTER,
        "#E69F00",
        GREY,
        "#CC79A7",
        "#999933",
        "#882255",
        "#44AA99",
        "#66CCEE",
        "#CC1111",
    )
    with drawing():
        figure, axes = plain(3.6)
        for (name, values), colour in zip(ledger.items(), colours, strict=True):
            if not np.any(values):  # the suspension's, in orbit
                continue
            line(axes, d.times, values, colour, 2.0 if name == "motors" else 1.1, name)
        axes.set(xlabel="time [s]", ylabel="energy [J]")
        axes.legend(ncols=2, loc="center left", fontsize=7.0)
        marked(axes, d)
        worst: Array = np.abs(ledger["residual"]).max()
        text = f"What both motors have put in, and where it is; {1e3 * float(worst):.2g} mJ at most are unexplained."
        return Picture(svg(figure), "Energies over time", text)
