"""What the report's figures share: style, colours told apart by colour-blind readers, and thinning of long lines."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .strips import StripDrawing, drawn, keep_whole
from .time_axes import is_over_time, over_time, with_time_axes

Array = NDArray[np.float64]

# Okabe & Ito (2008), Color universal design.
MEASURED = "#000000"
BEFORE = "#D55E00"
AFTER = "#0072B2"
SHADE = "#56B4E9"
GREY = "#9AA3AB"

_STYLE = {
    "svg.hashsalt": "snarelab",  # The same picture is the same bytes.
    "svg.fonttype": "none",  # The browser's own fonts: text stays text, and no glyph can be missing.
    "text.parse_math": False,  # A "$" in a column's name is a dollar sign.
    "figure.facecolor": "white",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "#56616B",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": False,
    "axes.xmargin": 0.01,
    "grid.color": "#E3E7EA",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "path.simplify_threshold": 0.2,
}
_DOTS_PER_INCH = 130

# On a dark page a picture's paper, ink and grid are the page's; what has a colour of its own keeps it. Print is light.
_DARK = """ <style>@media screen and (prefers-color-scheme:dark){
[style*="fill: #ffffff"]{fill:#14181c!important}[style*="fill: #000000"],text{fill:#e4e8ec!important}
[style*="stroke: #000000"]{stroke:#e4e8ec!important}[style*="stroke: #e3e7ea"]{stroke:#2c343b!important}
[style*="stroke: #56616b"]{stroke:#a2adb7!important}[style*="fill: #56616b"]{fill:#a2adb7!important}}</style>
"""


@contextmanager
def drawing() -> Iterator[None]:
    """The report's style for the length of a block; the user's own settings neither show nor change."""
    with style.context(["default", _STYLE]), warnings.catch_warnings():
        # Only the width of such a letter is unknown; the browser draws it.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def svg(figure: Figure) -> StripDrawing:
    """The figure as SVG with its time axes named, without a date: the same diagnosis draws the same picture."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", dpi=_DOTS_PER_INCH, metadata={"Date": None, "Creator": None})
    picture = buffer.getvalue().replace(b" <defs>", _DARK.encode("ascii") + b" <defs>", 1)
    return drawn(with_time_axes(picture, figure), figure)


def margins(figure: Figure, left: float, right: float, bottom: float, top: float) -> dict[str, float]:
    """Margins in inches as the fractions that matplotlib wants."""
    width, height = figure.get_size_inches()
    return {"left": left / width, "right": 1 - right / width, "bottom": bottom / height, "top": 1 - top / height}


def line(axes: Axes, time: Array, values: Array, colour: str, width: float = 0.8, label: str = "") -> None:
    """A signal over time, thinned to what the eye can see, broken where samples are missing.

    Its axes run over time from then on, in no recording that has a name unless `over_time` says so.
    """
    (shown,) = axes.plot(*thinned(time, values), color=colour, linewidth=width, label=label, solid_joinstyle="round")
    keep_whole(shown, time, values)
    if not is_over_time(axes):
        over_time(axes)


def thinned(time: Array, values: Array, columns: int = 700) -> tuple[Array, Array]:
    """Smallest and largest sample of each of ``columns`` stretches, in their order, NaN between runs of samples.

    time, values : (n_samples,). A run ends at a value that is not finite, or where time jumps by over five usual steps.
    Peaks survive, which picking each k-th sample would lose.
    """
    finite = np.isfinite(time) & np.isfinite(values)
    time, values, place = time[finite], values[finite], np.flatnonzero(finite)
    if time.size == 0:
        return time, values
    step = np.diff(time)
    usual = np.median(step) if step.size else 0.0
    breaks = np.flatnonzero((step > 5 * usual) | (np.diff(place) > 1)) + 1
    each = max(1, -(-time.size // columns))
    parts_time: list[Array] = []
    parts_values: list[Array] = []
    for t, v in zip(np.split(time, breaks), np.split(values, breaks), strict=True):
        kept = np.arange(v.size) if each <= 2 else _extremes(v, each)
        parts_time += [t[kept], t[-1:]]
        parts_values += [v[kept], np.array([np.nan])]
    return np.concatenate(parts_time[:-1]), np.concatenate(parts_values[:-1])


def _extremes(values: Array, each: int) -> np.ndarray:
    rows = np.pad(values, (0, -values.size % each), mode="edge").reshape(-1, each)
    picked = np.sort(np.stack([rows.argmin(axis=1), rows.argmax(axis=1)], axis=1), axis=1)
    places = (picked + each * np.arange(len(rows))[:, None]).ravel()
    # First and last sample stay, so that a run keeps its length.
    return np.unique(np.concatenate([[0], np.minimum(places, values.size - 1), [values.size - 1]]))
