"""Why cases of the box do not succeed, in words: how they miss, by how much, and on which side most of them stand."""

from collections import Counter

import numpy as np
import pandas as pd

from .gallery import kind_of_miss
from .study import Study

TOLD = 0.2
"""Difference between the shares that fail on the two sides of an axis, from which on a side is told."""


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
    kinds = Counter(kind_of_miss(study, row) or "without a result" for row in rows if not row["margin"] > 0)
    off = [1e3 * row["radial_error"] for row in rows if kind_of_miss(study, row) == "off the axis"]
    allowed = 1e3 * study.success.radial_error
    words = [
        f"{count} {kind}"
        + (f" (by {min(off):.1f} to {max(off):.1f} mm; {allowed:g} mm are allowed)" if kind == "off the axis" else "")
        for kind, count in kinds.most_common()
    ]
    return (
        f"Of {len(rows)} cases of the box {fails.sum()} do not succeed: {', '.join(words)}.{_side(study, box, fails)}"
    )


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
