"""The box in words: whether it lies within the envelope, and how, by how much and where those that fail miss."""

from collections import Counter

import numpy as np
import pandas as pd

from .gallery import Case, kind_of_miss
from .rays import Ray
from .study import Study
from .summary import Interval, nominal_point

TOLD = 0.2
"""Difference between the shares that fail on the two sides of an axis, from which on a side is told."""


def where_the_box_stands_out(study: Study, found: list[tuple[Ray, Interval]]) -> str:
    """A sentence that holds the box against the ends of the rays: along which of them it reaches beyond success.

    Empty where the nominal case fails or is not in the box: no ray then leaves the box from a success inside.

    Parameters
    ----------
    study : Study
    found : list of (Ray, Interval)
        As `rays.ends` has them.
    """
    centre = nominal_point(study)
    low, high = np.array([study.box.get(name, limits) for name, limits in study.ranges.items()]).T
    ways = [(ray, end, _reach(ray.tip - centre, low - centre, high - centre)) for ray, end in found]
    if np.any(centre < low) or np.any(centre > high) or any(np.isnan(end.value) for _, end in found):
        return ""
    beyond = [
        _beyond(study, ray, ray.tip - centre, end, share)
        for ray, end, share in ways
        if abs(end.high) < share * abs(ray.length)
    ]
    tried = f"{sum(share > 0 for *_, share in ways)} directions tried, everything else at nominal"
    if not beyond:
        return f"In none of the {tried}, does success end before the box."
    return f"The box is not within the envelope. Of {tried}, success ends before the box {'; '.join(beyond)}."


def _reach(way: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Share of a way from the nominal case that lies in the box, both as seen from there."""
    moved = way != 0
    return float(np.min(np.where(way > 0, high, low)[moved] / way[moved]))


def _beyond(study: Study, ray: Ray, way: np.ndarray, end: Interval, share: float) -> str:
    unit = study.capture.axis(ray.axes[0]).unit
    factor, unit = {"m": (1e3, "mm"), "rad": (180 / np.pi, "deg")}.get(unit, (1.0, unit))
    signs = dict(zip(study.ranges, way, strict=True))
    name = " ".join(f"{'-' if signs[axis] < 0 else '+'}{axis}" for axis in ray.axes)
    least, most = factor * abs(end.low), factor * abs(end.high)
    return f"towards {name}, at {least:.3g} to {most:.3g} {unit} of {factor * share * abs(ray.length):.3g}"


def why_the_box_fails(study: Study, box: pd.DataFrame) -> str:
    """A paragraph on the cases of the box.

    Parameters
    ----------
    study : Study
    box : DataFrame
        Its cases, as `Results.table` has them.
    """
    rows = box.to_dict("records")
    fails = np.array([not row["margin"] > 0 for row in rows], bool)
    if not fails.any():
        return f"All {len(rows)} cases of the box succeed."
    kinds = Counter(_kind(study, row) or "without a result" for row in rows if not row["margin"] > 0)
    off = [1e3 * row["radial_error"] for row in rows if _kind(study, row) == "off the axis"]
    allowed = 1e3 * study.success.radial_error
    words = [
        f"{count} {kind}"
        + (f" (by {min(off):.1f} to {max(off):.1f} mm; {allowed:g} mm are allowed)" if kind == "off the axis" else "")
        for kind, count in kinds.most_common()
    ]
    return (
        f"Of {len(rows)} cases of the box {fails.sum()} do not succeed: {', '.join(words)}.{_side(study, box, fails)}"
    )


def _kind(study: Study, row: Case) -> str:
    """What went wrong; of a study of the latch, where the program gave up."""
    if not study.success.latched or row["reason"]:
        return kind_of_miss(study, row)
    return "latched outside its bars" if row["state"] == "LATCHED" else f"given up in {row['state']}"


def _side(study: Study, box: pd.DataFrame, fails: np.ndarray) -> str:
    """The axis whose sides differ most in what fails; empty where none differs much."""
    shares = {}
    for name in study.ranges:
        x = box[name].to_numpy(float)
        above = x > 0.5 * (x.min() + x.max())
        if above.any() and not above.all():
            shares[name] = (np.mean(fails[above]) - np.mean(fails[~above]), above)
    name = max(shares, key=lambda name: abs(shares[name][0]), default=None)
    if name is None or abs(shares[name][0]) < TOLD:
        return ""
    difference, above = shares[name]
    words = [f"{fails[s].sum()} of {s.sum()} with {name} {side}" for s, side in ((above, "above"), (~above, "below"))]
    most, least = words if difference > 0 else words[::-1]
    return f" Most of them stand on one side: {most} its middle, but {least}."
