"""``result.json`` and the table for a terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from snarelab.studies.outcome import Quantity

from .score import Figure, Score
from .seal import Seal


def result(
    scores: Mapping[str, Score], seal: Seal, seconds: float, each: Sequence[float], tool: str = "snarelab"
) -> dict[str, Any]:
    """What `result.json` holds: the tool's figures by name, a rival's as ``rival.name``; a missing figure is "n/a"."""
    quantities = []
    for method, score in scores.items():
        for figure in score.figures.values():
            name = figure.name if method == tool else f"{method}.{figure.name}"
            ours = "n/a" if figure.value is None else figure.value
            quantities.append(Quantity(name, "1", ours, "reference", None, figure.low, figure.high))
    own = scores[tool].figures
    return {
        "study": "proof",
        "command": "make proof",
        "seconds": round(seconds, 1),
        "quantities": [asdict(q) for q in quantities],
        "bars": {f.name: {"bar": f.bar, "at_most": f.at_most, "met": f.met} for f in own.values() if f.bar is not None},
        "counts": {f.name: f.count for f in own.values()},
        "behind": [list(pair) for pair in behind(scores, tool)],
        "seed": seal.seed,
        "cases": seal.cases,
        "answers_sha256": seal.answers,
        "recordings_sha256": seal.recordings,
        "sealed_at": seal.time,
        "seconds_a_diagnosis": round(sum(each) / len(each), 1),
    }


def behind(scores: Mapping[str, Score], tool: str = "snarelab") -> list[tuple[str, str]]:
    """(figure, rival) wherever a rival does better on a figure with a bar, or on the error on the third recording."""
    found = []
    for name, own in scores[tool].figures.items():
        for rival in scores:
            other = scores[rival].figures[name]
            counts = own.bar is not None or name in ("third_error", "right_moved")
            if rival == tool or own.value is None or other.value is None or not counts:
                continue
            if (other.value < own.value) if own.at_most else (other.value > own.value):
                found.append((name, rival))
    return found


def shown(figure: Figure) -> str:
    """A figure as text: shares in per cent, the rest as numbers."""
    if figure.value is None:
        return "n/a"
    if is_share(figure):
        return f"{100.0 * figure.value:.0f} %"
    return f"{figure.value:.3g}"


def interval(figure: Figure) -> str:
    """Its interval as text; empty where there is none."""
    if figure.low is None or figure.high is None or figure.value is None:
        return ""
    if is_share(figure):
        return f"{100.0 * figure.low:.0f} to {100.0 * figure.high:.0f} %"
    return f"{figure.low:.3g} to {figure.high:.3g}"


def is_share(figure: Figure) -> bool:
    """Whether it counts cases."""
    return not figure.name.startswith(("closure", "calibration", "third", "class"))


def terminal(scores: Mapping[str, Score], tool: str = "snarelab") -> str:
    """The table: a line a figure, a column a method."""
    rivals = [name for name in scores if name != tool]
    lines = [f"  {'figure':<20}{'bar':>8}{tool:>12}  {'95 %':<16}{'cases':>6}" + "".join(f"{r:>19}" for r in rivals)]
    for f in scores[tool].figures.values():
        sign = "" if f.bar is None else f"{'≤' if f.at_most else '≥'} {f.bar:g}"
        mark = {True: " ", False: "!", None: " "}[f.met]
        lines.append(
            f"{mark} {f.name:<20}{sign:>8}{shown(f):>12}  {interval(f):<16}{f.count:>6}"
            + "".join(f"{shown(scores[r].figures[f.name]):>19}" for r in rivals)
        )
    return "\n".join(lines)
