"""Tables that stand for physics without a name: a curve with its band, or a map of values and one of deviations."""

import numpy as np
from matplotlib.figure import Figure

from ...models.table import TIMES, Table
from ...report.drawing import AFTER, GREY, drawing, margins, svg
from ...report.html import figure
from ...report.words import unit_words
from ..diagnosis import EmpiricalTable

_POINTS = 201


def tables(found: tuple[EmpiricalTable, ...]) -> str:
    """All of them, each a picture with its words."""
    return "".join(figure(drawn(t), words_of(t), words_of(t), small=True) for t in found)


def words_of(t: EmpiricalTable) -> str:
    """What stands in the picture of a table."""
    over = " and ".join(t.over) + TIMES[t.times]
    shown = "Band: two standard deviations." if len(t.over) == 1 else "Right: its standard deviation."
    return f"Empirical law at {t.at} over {over}, without a name. {shown} Outside, the end value is held."


def _along(t: EmpiricalTable, k: int) -> str:
    """What lies along an axis: a coordinate of the joint, or of another by name, with its unit."""
    over = t.over[k]
    return f"{over if ' of ' in over else f'{over} of {t.at}'} [{unit_words(t.over_units[k])}]"


def drawn(t: EmpiricalTable) -> bytes:
    """A table as the laws read it, cubic between its knots."""
    knots = tuple(tuple(k.tolist()) for k in t.knots)
    table = Table(t.over, t.times, knots)
    with drawing():
        if len(knots) == 1:
            chart = Figure(figsize=(5.4, 2.8))
            axes = chart.subplots()
            chart.subplots_adjust(**margins(chart, 0.75, 0.15, 0.5, 0.15))
            x = np.linspace(knots[0][0], knots[0][-1], _POINTS)
            value, std = table.weights([x]) @ t.value, np.interp(x, t.knots[0], t.std)
            axes.axhline(0, color=GREY, linewidth=0.6)
            axes.fill_between(x, value - 2 * std, value + 2 * std, color=AFTER, alpha=0.25, linewidth=0)
            axes.plot(x, value, color=AFTER, linewidth=1.6)
            axes.set_xlabel(_along(t, 0))
            axes.set_ylabel(f"value [{unit_words(t.unit)}]")
            return svg(chart)
        chart = Figure(figsize=(10.0, 3.4))
        chart.subplots_adjust(**margins(chart, 0.75, 0.4, 0.5, 0.4), wspace=0.3)
        for axes, numbers, title in zip(chart.subplots(1, 2), (t.value, t.std), ("value", "deviation"), strict=True):
            mesh = axes.pcolormesh(t.knots[0], t.knots[1], numbers.T, shading="gouraud", rasterized=True)
            chart.colorbar(mesh, ax=axes, label=f"{title} [{unit_words(t.unit)}]")
            axes.set_xlabel(_along(t, 0))
            axes.set_ylabel(_along(t, 1))
        return svg(chart)
