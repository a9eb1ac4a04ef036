"""Axes of the orbit studies' figures: one wide panel, or several over one time axis."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...report.drawing import margins


def plain(height: float) -> tuple[Figure, Axes]:
    """One panel of a height [in]."""
    figure = Figure(figsize=(9.0, height))
    axes: Any = figure.subplots()
    figure.subplots_adjust(**margins(figure, 0.7, 0.1, 0.5, 0.15))
    return figure, axes


def panels(rows: int, height: float) -> tuple[Figure, list[Axes]]:
    """Panels one above the other, of a height together [in]."""
    figure = Figure(figsize=(9.0, height))
    axes: list[Axes] = list(figure.subplots(rows, 1, sharex=True))
    axes[-1].set_xlabel("time [s]")
    figure.subplots_adjust(**margins(figure, 0.7, 0.1, 0.5, 0.15), hspace=0.15)
    return figure, axes
