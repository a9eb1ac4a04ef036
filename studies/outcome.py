"""What a study leaves behind for scripts: ``result.json``, and the same numbers as a table for people."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ..files import written_whole

FOLDER = Path("build/studies")


@dataclass(frozen=True)
class Quantity:
    """One number of a study beside the paper's.

    Parameters
    ----------
    name, unit : str
    ours : float or str
        A number, or names, one after the other with commas between.
    kind : "calibrated", "predicted" or "reference"
        Calibrated: a free parameter was set to meet the paper's number. Reference: no agreement is claimed, since the
        paper has no number, or one that measures something else.
    paper : float or None
    low, high : float or None
        Interval of ours, where one is known.
    """

    name: str
    unit: str
    ours: float | str
    kind: Literal["calibrated", "predicted", "reference"]
    paper: float | None = None
    low: float | None = None
    high: float | None = None


def interval(value: float, std: float) -> tuple[float, float] | tuple[None, None]:
    """Two deviations either way; none where the recordings leave a value open."""
    return (value - 2 * std, value + 2 * std) if math.isfinite(std) else (None, None)


def write_result(
    study: str, quantities: Sequence[Quantity], seconds: float, extra: Mapping[str, Any] | None = None
) -> Path:
    """Write ``build/studies/<study>/result.json``, whole or not at all; returns its path."""
    folder = FOLDER / study
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "study": study,
        "command": f"make study-{study}",
        "seconds": round(seconds, 1),
        "quantities": [asdict(q) for q in quantities],
        **(extra or {}),
    }
    return write_json(folder / "result.json", content)


def write_json(path: Path, content: Mapping[str, Any]) -> Path:
    """Write a file of JSON, whole or not at all; returns its path."""
    with written_whole(path) as part:
        part.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path


def table(quantities: Sequence[Quantity]) -> str:
    """The quantities for a terminal: name, paper, ours, interval, kind."""
    lines = [f"  {'quantity':<32}{'paper':>12}{'ours':>14}  {'interval':<24}{'unit':<8}kind"]
    for q in quantities:
        ours = q.ours if isinstance(q.ours, str) else f"{q.ours:.6g}"
        paper = "" if q.paper is None else f"{q.paper:g}"
        interval = "" if q.low is None or q.high is None else f"{q.low:.4g} to {q.high:.4g}"
        lines.append(f"  {q.name:<32}{paper:>12}{ours:>14}  {interval:<24}{q.unit:<8}{q.kind}")
    return "\n".join(lines)
