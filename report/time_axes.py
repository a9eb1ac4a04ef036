"""Which axes of a drawing run over time, and where: the picture itself says so, and a page can put a cursor there."""

import json
import re
from html import escape

from matplotlib.axes import Axes
from matplotlib.figure import Figure

_MARK = "over time: "


def over_time(axes: Axes, recording: str = "") -> None:
    """Say that x is time [s] in a recording; plots of one recording share a cursor. A study's own run has no name."""
    axes.set_label(_MARK + recording)


def is_over_time(axes: Axes) -> bool:
    """Whether `over_time` was said of these axes."""
    return str(axes.get_label()).startswith(_MARK)


def recording_of(axes: Axes) -> str:
    """The name that `over_time` gave."""
    return str(axes.get_label()).removeprefix(_MARK)


def with_time_axes(svg: bytes, figure: Figure) -> bytes:
    """The drawn figure's SVG, its root with the attribute ``data-time-axes`` where any axes run over time.

    The attribute is a JSON list: ``box`` (left, top, width, height as shares of the picture), ``limits`` [s], and
    ``recording``.
    """
    found = [
        {"box": _box(axes), "limits": list(axes.get_xlim()), "recording": recording_of(axes)}
        for axes in figure.axes
        if is_over_time(axes)
    ]
    if not found:
        return svg
    return svg.replace(b"<svg ", f'<svg data-time-axes="{escape(json.dumps(found))}" '.encode("ascii"), 1)


def time_axes(svg: bytes) -> str:
    """The attribute that `with_time_axes` wrote, as markup with a space before it; empty where there is none."""
    found = re.search(rb'<svg( data-time-axes="[^"]*")', svg)
    return found[1].decode("ascii") if found else ""


def _box(axes: Axes) -> list[float]:
    place = axes.get_position()
    return [round(float(x), 5) for x in (place.x0, 1 - place.y1, place.width, place.height)]
