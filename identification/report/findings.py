"""The report's first three parts: the verdict, what is missing (or what would have been seen), and where."""

from collections.abc import Sequence
from datetime import date
from html import escape

from ...report.html import bar, figure, flag, headline, paragraph, table
from ..diagnosis import Diagnosis, Finding, Limit, Rival, Trace
from .figures import residual_over_time
from .words import chance, number, percent, spans, unit_words, with_std, words

STATUS = {
    "data_fault": "fault in the data",
    "missing_physics": "missing physics",
    "adequate": "adequate",
    "unknown_effect": "unknown effect",
}
_WORST = 4


def verdict(diagnosis: Diagnosis, day: date) -> str:
    """The verdict in large type, and what it stands on."""
    recordings = {
        role: list(dict.fromkeys(trace.recording for trace in diagnosis.traces if trace.role == role))
        for role in ("train", "holdout")
    }
    facts = [
        ("Model", diagnosis.model),
        ("Fitted on", ", ".join(recordings["train"])),
        ("Never seen by the fit", ", ".join(recordings["holdout"])),
        ("Analysis band", f"0 to {diagnosis.band:g} Hz"),
        ("Date", day.isoformat()),
    ]
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts if value)
    return (
        f'<span class="status {diagnosis.verdict}">{STATUS[diagnosis.verdict]}</span>\n'
        f'{headline(diagnosis.sentence)}<dl class="facts">{rows}</dl>\n'
    )


def missing(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """What is missing, one card an effect; the detection limits or the description where there is nothing to name."""
    if diagnosis.verdict == "adequate":
        return "missing", "What would have been seen", detection_limits(diagnosis)
    text = paragraph(diagnosis.description)
    if diagnosis.verdict == "unknown_effect":
        return "missing", "What is known about it", f'<article class="card">{text}</article>\n'
    cards = "".join(_card(finding) for finding in diagnosis.effects)
    if diagnosis.description:
        cards += f'<article class="card"><h3>Without a name</h3>\n{text}</article>\n'
    return "missing", "What is missing", cards


def checked(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """What of the recordings and the model is not as it should be, with the lines that mend it."""
    rows = [
        [
            escape(words(check.name)),
            escape(check.at),
            chance(check.probability),
            escape(check.message),
            "<br>".join(f"<code>{escape(line)}</code>" for line in check.mend.splitlines()),
        ]
        for check in diagnosis.checks
    ]
    heads = ["Check", "At", "Probability", "What", "Line that mends it"]
    return "checks", "Is the data sound?", table("What is not as it should be", heads, rows, (2,))


def where(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Where and when the residual stands, as rows and as a picture of the worst channels."""
    if not diagnosis.location:
        return "where", "Where", paragraph("No channel, time or state stands out in the residual.")
    rows = [
        [
            escape(place.channel),
            bar(place.share, percent(place.share)),
            escape(spans(place.time_windows)),
            escape(place.where) or "–",
        ]
        for place in diagnosis.location
    ]
    content = table("Residual of the model as it was", ["Channel", "Share of all", "When", "In which state"], rows)
    seen: dict[str, Trace] = {}
    for trace in diagnosis.traces:
        if trace.role == "train":
            seen.setdefault(trace.channel, trace)
    worst = sorted(diagnosis.location, key=lambda place: -place.share)
    channels = dict.fromkeys(place.channel for place in worst)
    first = [seen[channel] for channel in channels if channel in seen][:_WORST]
    if first:
        content += figure(
            residual_over_time(first, diagnosis.location),
            "Residual before over time, with the table's windows shaded: "
            f"{', '.join(trace.channel for trace in first)}.",
            "Measurement minus the model as it was. Shaded: the time windows of the table.",
        )
    return "where", "Where", content


def detection_limits(diagnosis: Diagnosis) -> str:
    """The smallest size of each effect, at the place where it would have shown best and worst."""
    if not diagnosis.limits:
        return paragraph("No limits of detection were worked out for these recordings.")
    kinds: dict[tuple[str, str, str], list[Limit]] = {}
    for limit in diagnosis.limits:
        kinds.setdefault((limit.name, limit.parameter, limit.unit), []).append(limit)
    rows = []
    for (name, parameter, unit), limits in kinds.items():
        ordered = sorted(limits, key=lambda x: x.value)
        ends = [f"{number(x.value)} {unit_words(unit)} at {x.at}".replace("  ", " ") for x in (ordered[0], ordered[-1])]
        rows.append([escape(words(name)), escape(words(parameter)), *(escape(end) for end in ends)])
    text = "An effect smaller than this would not have stood out of these recordings."
    return paragraph(text) + table("Limits of detection", ["Effect", "Parameter", "Best seen", "Worst seen"], rows)


def _card(finding: Finding) -> str:
    name = words(finding.name)
    rows = []
    for parameter, estimate in finding.parameters.items():
        value, std = with_std(estimate.value, estimate.std)
        rows.append(
            [
                escape(words(parameter)),
                value,
                f"± {std}",
                escape(unit_words(estimate.unit)) or "–",
                flag("at its bound") if estimate.at_bound else "",
            ]
        )
    parameters = table("Parameters", ["Name", "Value", "Std", "Unit", ""], rows, (1, 2), False) if rows else ""
    return (
        f'<article class="card"><header><h3>{escape(name[:1].upper() + name[1:])} at {escape(finding.at)}</h3>'
        f"<span>probability {chance(finding.probability)}</span></header>\n"
        f"{paragraph(finding.evidence)}{parameters}{_rivals(finding.rivals)}</article>\n"
    )


def _rivals(rivals: Sequence[Rival]) -> str:
    if not rivals:
        return paragraph("No rival explanation is left.", "quiet")
    rows = [
        [
            f"{escape(words(rival.name))} at {escape(rival.at)}",
            chance(rival.probability),
            "these recordings tell them apart" if rival.separable else "these recordings cannot tell them apart",
            escape(rival.experiment) or "–",
        ]
        for rival in rivals
    ]
    heads = ["Rival explanation", "Probability", "Told apart?", "Experiment that would"]
    return table("What else it could be", heads, rows, numeric=(1,))
