"""What axes over time show, kept beside the picture that is drawn of it: a page can draw it once more, to be zoomed."""

from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from .time_axes import is_over_time, recording_of

Array = NDArray[np.float64]

_INK = "#000000"
_WHOLE: WeakKeyDictionary[Line2D, tuple[Array, Array]] = WeakKeyDictionary()
"""Of a thinned line, every sample."""


@dataclass(frozen=True)
class Curve:
    """A signal over time, (n_samples,) each [s] and [the strip's unit]; ``colour`` "ink" is the page's own."""

    label: str
    time: Array
    values: Array
    colour: str


@dataclass(frozen=True)
class Strip:
    """Axes over time with what stands in them; ``windows`` [s] are shaded. Strips of one recording share their time."""

    title: str
    unit: str
    curves: Sequence[Curve]
    windows: Sequence[tuple[float, float]] = ()
    recording: str = ""


class StripDrawing(bytes):
    """A picture as SVG, with what its axes over time show; no strips where a page could not show all of it."""

    strips: tuple[Strip, ...] = ()


def keep_whole(line: Line2D, time: Array, values: Array) -> None:
    """Remember the samples of a line that was thinned."""
    _WHOLE[line] = (np.asarray(time, float), np.asarray(values, float))


def drawn(svg: bytes, figure: Figure) -> StripDrawing:
    """The picture with its strips: none unless all axes run over time, and hold lines and shaded windows only."""
    picture = StripDrawing(svg)
    strips = [_strip(axes) for axes in figure.axes]
    known = [strip for strip in strips if strip is not None and strip.curves]
    if len(known) == len(strips):
        picture.strips = tuple(known)
    return picture


def _strip(axes: Axes) -> Strip | None:
    """What stands in these axes; None where that is not lines over time alone."""
    if not is_over_time(axes) or axes.collections or axes.texts or axes.images:
        return None
    if axes.get_yscale() != "linear" or any(not isinstance(patch, Rectangle) for patch in axes.patches):
        return None
    limits = axes.get_xlim()
    curves: list[Curve] = []
    for line in axes.lines:
        time, values = _WHOLE.get(line) or (np.asarray(part, float) for part in line.get_data())
        if line.get_transform() == axes.get_yaxis_transform(which="grid"):  # level, over the whole width
            time = np.array(limits)
        elif line.get_transform() != axes.transData or np.isfinite(time).sum() == 0:
            return None
        label, colour = str(line.get_label()), to_hex(line.get_color())
        curves.append(Curve("" if label.startswith("_") else label, time, values, "ink" if colour == _INK else colour))
    windows = [(p.get_x(), p.get_x() + p.get_width()) for p in axes.patches if isinstance(p, Rectangle)]
    said = [text for text in (axes.get_title(loc="left"), axes.get_ylabel()) if text]
    return Strip(": ".join(said), "", curves, windows, recording_of(axes))
