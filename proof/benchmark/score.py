"""The figures of one tool's answers: names, as the second proof counts them, and torque that nobody was given."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..drives.judge import judge
from ..drives.table import Figure, figures
from .answers import read_answers
from .case_set import CaseSet, columns, in_band


def score(cases: CaseSet, path: Path) -> tuple[str, list[Figure]]:
    """The tool's name and all figures; every case of the set counts.

    Raises
    ------
    ValueError
        An answer that breaks the rules, predicted torque of another length, or a truth that is not there.
    """
    names, truths = cases.names(), cases.truths()
    tool, answers = read_answers(path, cases)
    judged = [judge(answers[name] | {"case": name, "truth": truths[name]}) for name in names]
    folder = path.parent / "torque"
    found = [_ratio(cases, name, truths[name], folder) for name in names if truths[name]["effects"]]
    ratios = [ratio for ratio in found if ratio is not None]
    count = len(ratios)
    return tool, [
        *figures(judged),
        Figure("torque error over the baseline's, median", float(np.median(ratios)) if ratios else None, count),
        Figure("torque error over the baseline's, worst", max(ratios, default=None), count),
    ]


def _ratio(cases: CaseSet, name: str, truth: Mapping[str, Any], folder: Path) -> float | None:
    """Predicted torque's RMS error over that of the textbook baseline, where the concealed effect is largest; None
    where nothing was predicted."""
    path = folder / f"{name}.csv"
    if not path.exists():
        return None
    channel = max(truth["effects"], key=lambda e: e["size"])["channel"]
    predicted, time = columns(path), columns(cases.case(name) / "predict.csv")["time"]
    measured = cases.torque(name)
    if channel not in predicted or len(predicted[channel]) != len(time):
        raise ValueError(f"{path}: {channel} with {len(time)} rows is wanted, one for each row of predict.csv")
    if not np.isfinite(predicted[channel]).all():
        raise ValueError(f"{path}: {channel} has values that are no numbers")
    left = in_band(measured[channel] - predicted[channel], time)
    return float(np.sqrt(np.mean(left**2))) / truth["baseline_rms"][channel]
