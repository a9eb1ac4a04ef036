"""Figures of all generators beside their bars, as a table in Markdown: what stands in docs/proof.md."""

from collections.abc import Mapping
from typing import Any

LEFT_OUT = "calibration error of names told, by a map of the other generators"

BESIDE = {
    "clean: told that something has no name": [0.02, "at most"],
    "wrong names a case": [0.1, "at most"],
    "true values of right names within two deviations": [0.98, "at most"],
    LEFT_OUT: [0.05, "at most"],
}
"""Bars that were not registered: figures that are counted in any case, held to what was asked for."""

WORDS = {"at most": "≤", "at least": "≥"}


def table(found: Mapping[str, Any]) -> str:
    """A row a bar, a column a generator, bold where the bar is missed.

    Parameters
    ----------
    found : mapping
        As `register.result` gives it; figures of `left_out.of_files` beside each generator's own.
    """
    generators = found["generators"]
    rows = ["| figure | bar | " + " | ".join(f"`{g}`" for g in generators) + " |"]
    rows.append("| --- | ---: |" + " ---: |" * len(generators))
    for name, (bar, way) in [*found["registered"]["bars"].items(), *BESIDE.items()]:
        if not any(name in own for own in generators.values()):
            continue
        share = any(own[name].get("interval") for own in generators.values())
        limit = f"{WORDS[way]} {100 * bar:g} %" if share else f"{WORDS[way]} {bar:g}"
        cells = [_cell(own[name], share, bar, way) for own in generators.values()]
        rows.append(f"| {name} | {limit} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _cell(figure: Mapping[str, Any], share: bool, bar: float, way: str) -> str:
    value = figure["value"]
    if value is None:
        return "–"
    text = f"{100 * value:.0f} % of {figure['cases']}" if share else f"{value:.2f}"
    return text if (value <= bar if way == "at most" else value >= bar) else f"**{text}**"
