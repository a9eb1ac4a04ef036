"""The report's first sheet: picture before and after, names with values, what is alike, what to do next, provenance."""

from html import escape

from ...report.html import paragraph, table
from ...report.provenance import Provenance
from ...report.words import chance, measured, percent, words
from ..diagnosis import Diagnosis, Finding
from ..summary import indistinguishable
from .fit import comparison, most_changed

_MOST = 8
"""Names for which the first printed sheet has room."""
_FEW = 3
"""Lines of what is alike, and of what to do next, for which it has room."""


def answer(diagnosis: Diagnosis, origin: Provenance) -> tuple[str, str, str]:
    """The whole answer, as it fits on one printed sheet."""
    content = ""
    for trace in most_changed(diagnosis)[:1]:
        content += comparison(diagnosis, trace)[1]
    if diagnosis.effects:
        content += _names(diagnosis)
    alike = _alike(diagnosis)
    content += f"<h3>What could not be told apart</h3>\n{alike}" if diagnosis.effects else ""
    content += f"<h3>What to do next</h3>\n{_next(diagnosis)}"
    content += f"<h3>Files and versions</h3>\n{origin.markup()}"
    return "answer", "The answer", content


def _names(diagnosis: Diagnosis) -> str:
    shares = {(c.name, c.at): c.explained for c in diagnosis.candidates}
    shown = sorted(diagnosis.effects, key=lambda finding: -finding.probability)[:_MOST]
    shown = [finding for finding in diagnosis.effects if finding in shown]
    rows = []
    for finding in shown:
        name = words(finding.name)
        share = shares.get((finding.name, finding.at))
        rows.append(
            [
                f"{escape(name[:1].upper() + name[1:])} at {escape(finding.at)}",
                _values(finding),
                chance(finding.probability),
                "–" if share is None else percent(min(share, 1.0), 3),
            ]
        )
    caption = "What the model leaves out. Share: of the residual's energy that it explains by itself; shares overlap"
    heads = ["Effect", "Value ± deviation", "Probability", "Share"]
    more = len(diagnosis.effects) - len(shown)
    rest = paragraph(f"And {more} more that are less likely: see what is missing, below.") if more else ""
    return table(caption, heads, rows, numeric=(2, 3)) + rest


def _values(finding: Finding) -> str:
    said = []
    for name, estimate in finding.parameters.items():
        bound = " (at its bound)" if estimate.at_bound else ""
        text = f"{words(name)} {measured(estimate.value, estimate.std, estimate.unit)}{bound}"
        said.append(f'<span class="kept">{escape(text)}</span>')
    return "; ".join(said) or "–"


def _alike(diagnosis: Diagnosis) -> str:
    pairs = indistinguishable(diagnosis.effects)
    if not pairs:
        return paragraph("These recordings separate every name from its rivals.")
    lines = [f"{words(finding.name)} at {finding.at}, or {rival}" for finding, rival, _ in pairs]
    return "".join(map(paragraph, _first(lines, _FEW)))


def _first(lines: list[str], most: int) -> list[str]:
    """So many lines as there is room for; the last says how many stand below."""
    if len(lines) <= most:
        return lines
    return [*lines[: most - 1], f"And {len(lines) - most + 1} more, below with their names."]


def _next(diagnosis: Diagnosis) -> str:
    experiments = dict.fromkeys(
        f"{experiment[:1].upper()}{experiment[1:]}"
        for _, _, experiment in indistinguishable(diagnosis.effects)
        if experiment
    )
    if experiments:
        return "".join(paragraph(f"{text}.".replace("..", ".")) for text in _first(list(experiments), _FEW))
    return paragraph(
        {
            "missing_physics": "Take the improved model (--save-model) and diagnose it on a third recording: is it "
            "adequate there as well?",
            "data_fault": "Correct what the checks below name, and diagnose again.",
            "adequate": "Nothing, unless an effect smaller than the limits of detection below would matter.",
            "unknown_effect": "Look at the channel, the times and the states below, and record that motion again: "
            "does the residual recur?",
        }[diagnosis.verdict]
    )
