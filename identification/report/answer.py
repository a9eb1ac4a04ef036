"""The report's first sheet: picture before and after, names with values, what is alike, what to do next, provenance."""

from html import escape

from ...report.html import paragraph, table
from ...report.provenance import Provenance
from ..diagnosis import Diagnosis, Finding
from ..summary import indistinguishable
from .fit import comparison, most_changed
from .words import chance, percent, unit_words, with_std, words


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
    content += f"<h3>What this stands on</h3>\n{origin.markup()}"
    return "answer", "The answer", content


def _names(diagnosis: Diagnosis) -> str:
    shares = {(c.name, c.at): c.explained for c in diagnosis.candidates}
    rows = []
    for finding in diagnosis.effects:
        name = words(finding.name)
        share = shares.get((finding.name, finding.at))
        rows.append(
            [
                f"{escape(name[:1].upper() + name[1:])} at {escape(finding.at)}",
                _values(finding),
                chance(finding.probability),
                "–" if share is None else percent(min(share, 1.0)),
            ]
        )
    caption = "What the model leaves out. Share: of the residual's energy that it explains by itself; shares overlap"
    return table(caption, ["Effect", "Value ± deviation", "Probability", "Share"], rows, numeric=(2, 3))


def _values(finding: Finding) -> str:
    said = []
    for name, estimate in finding.parameters.items():
        value, std = with_std(estimate.value, estimate.std)
        bound = " (at its bound)" if estimate.at_bound else ""
        said.append(f"{escape(words(name))} {value} ± {std} {escape(unit_words(estimate.unit))}{bound}".rstrip())
    return "<br>".join(said) or "–"


def _alike(diagnosis: Diagnosis) -> str:
    pairs = indistinguishable(diagnosis.effects)
    if not pairs:
        return paragraph("Every name was told apart from its rivals by these recordings.")
    return "".join(paragraph(f"{words(finding.name)} at {finding.at}, or {rival}") for finding, rival, _ in pairs)


def _next(diagnosis: Diagnosis) -> str:
    experiments = dict.fromkeys(
        f"{experiment[:1].upper()}{experiment[1:]}"
        for _, _, experiment in indistinguishable(diagnosis.effects)
        if experiment
    )
    if experiments:
        return "".join(paragraph(f"{text}.".replace("..", ".")) for text in experiments)
    return paragraph(
        {
            "missing_physics": "Take the improved model (--save-model) and diagnose it on a third recording: is it "
            "adequate there as well?",
            "data_fault": "Mend what the checks below say, and diagnose again.",
            "adequate": "Nothing, unless an effect smaller than the limits of detection below would matter.",
            "unknown_effect": "Look at the channel, the times and the states below, and record the same motion again: "
            "does it come back?",
        }[diagnosis.verdict]
    )
