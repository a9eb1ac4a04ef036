"""Figures of all generators beside their bars, as a table in Markdown: what stands in docs/proof.md."""

from collections.abc import Mapping
from typing import Any

WORDS = {"at most": "≤", "at least": "≥"}


def table(found: Mapping[str, Any]) -> str:
    """A row a bar, a column a generator, bold where the bar is missed.

    Parameters
    ----------
    found : mapping
        As `register.result` gives it.
    """
    generators = found["generators"]
    rows = ["| figure | bar | " + " | ".join(f"`{g}`" for g in generators) + " |"]
    rows.append("| --- | ---: |" + " ---: |" * len(generators))
    for name, (bar, way) in found["registered"]["bars"].items():
        share = any(own[name]["interval"] for own in generators.values())
        limit = f"{WORDS[way]} {100 * bar:g} %" if share else f"{WORDS[way]} {bar:g}"
        cells = [_cell(own[name], share) for own in generators.values()]
        rows.append(f"| {name} | {limit} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _cell(figure: Mapping[str, Any], share: bool) -> str:
    if figure["value"] is None:
        return "–"
    text = f"{100 * figure['value']:.0f} % of {figure['cases']}" if share else f"{figure['value']:.2f}"
    return text if figure["met"] else f"**{text}**"
