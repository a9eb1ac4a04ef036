"""The report's first three parts: the verdict, what is missing (or what would have been seen), and where."""

from collections.abc import Sequence
from datetime import date
from html import escape

from ...report.drawing import BEFORE
from ...report.html import bar, figure, flag, folded, headline, paragraph, table
from ...report.strips import Curve, Strip
from ...report.words import chance, number, percent, spans, unit_words, with_std, words
from ...report.zoom import zoomable
from ..diagnosis import Diagnosis, Finding, FrictionCurve, Limit, Location, Rival, Trace
from .curves import friction_over_speed, friction_words
from .figures import residual_over_time
from .tables import tables

STATUS = {
    "data_fault": "fault in the data",
    "missing_physics": "missing physics",
    "adequate": "adequate",
    "unknown_effect": "unknown effect",
}
_WORST = 4
_CHANNELS = ("tau.", "q.", "qd.", "q_link.")


def verdict(diagnosis: Diagnosis, day: date) -> str:
    """The verdict in large type, and what it stands on."""
    recordings = {
        role: list(dict.fromkeys(trace.recording for trace in diagnosis.traces if trace.role == role))
        for role in ("train", "holdout")
    }
    facts = [
        ("Model", diagnosis.model),
        ("Training", ", ".join(recordings["train"])),
        ("Held-out", ", ".join(recordings["holdout"])),
        ("Analysis band", f"0 to {diagnosis.band:.3g} Hz"),
        ("Date", day.isoformat()),
    ]
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in facts if value)
    return (
        f'<span class="status {diagnosis.verdict}">{STATUS[diagnosis.verdict]}</span>\n'
        f'{headline(diagnosis.sentence)}<dl class="facts">{rows}</dl>\n'
    )


def missing(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """What is missing, joint by joint; the detection limits or the description where there is nothing to name."""
    if diagnosis.verdict == "adequate":
        return "missing", "What would have been seen", detection_limits(diagnosis)
    text = paragraph(diagnosis.description)
    if diagnosis.verdict == "unknown_effect":
        return (
            "missing",
            "What is known about it",
            f'<article class="card">{text}{tables(diagnosis.empirical)}</article>\n',
        )
    curves = {curve.at: curve for curve in diagnosis.curves if curve.kind == "joint"}
    cards = "".join(_card(place, group, curves.get(place)) for place, group in _by_place(diagnosis.effects).items())
    if diagnosis.description:
        cards += f'<article class="card"><h3>Without a name</h3>\n{text}{tables(diagnosis.empirical)}</article>\n'
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
    return "checks", "Is the data sound?", table("Findings of the check", heads, rows, (2,))


def where(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Where and when the residual stands, as rows and as a picture of the worst channels."""
    if not diagnosis.location:
        return "where", "Where", paragraph("No channel, time or state stands out in the residual.")
    rows = [
        [
            escape(place.channel),
            bar(place.share, percent(place.share, 3)),
            escape(spans(place.time_windows)),
            escape(place.where) or "–",
        ]
        for place in diagnosis.location
    ]
    content = table("Residual of the model as given", ["Channel", "Share of all", "When", "In which state"], rows)
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
            "Measurement minus the model as given. Shaded: the time windows of the table.",
            zoom=_zoomable(first, diagnosis.location),
        )
    return "where", "Where", content


def _zoomable(traces: Sequence[Trace], places: Sequence[Location]) -> str:
    strips = [
        Strip(
            f"{trace.channel}, {trace.recording}",
            unit_words(trace.unit),
            [Curve("", trace.time, trace.measured - trace.before, BEFORE)],
            [window for place in places if place.channel == trace.channel for window in place.time_windows],
            trace.recording,
        )
        for trace in traces
    ]
    return zoomable(strips, "residual before over time")


def detection_limits(diagnosis: Diagnosis) -> str:
    """The smallest size of each effect, at the place where it would have shown best and worst."""
    if not diagnosis.limits:
        return paragraph("No limits of detection were computed for these recordings.")
    kinds: dict[tuple[str, str, str], list[Limit]] = {}
    for limit in diagnosis.limits:
        kinds.setdefault((limit.name, limit.parameter, limit.unit), []).append(limit)
    rows = []
    for (name, parameter, unit), limits in kinds.items():
        ordered = sorted(limits, key=lambda x: x.value)
        ends = [f"{number(x.value)} {unit_words(unit)} at {x.at}".replace("  ", " ") for x in (ordered[0], ordered[-1])]
        rows.append([escape(words(name)), escape(words(parameter)), *(escape(end) for end in ends)])
    text = "These recordings would not show an effect smaller than this."
    return paragraph(text) + table("Limits of detection", ["Effect", "Parameter", "Best seen", "Worst seen"], rows)


def _by_place(findings: Sequence[Finding]) -> dict[str, list[Finding]]:
    """Findings by the joint, link or sling they stand at; a sensor's with those of its joint."""
    groups: dict[str, list[Finding]] = {}
    for finding in findings:
        place = finding.at.partition(".")[2] if finding.at.startswith(_CHANNELS) else finding.at
        groups.setdefault(place, []).append(finding)
    return groups


def _card(place: str, findings: Sequence[Finding], curve: FrictionCurve | None = None) -> str:
    """All that was found at one place: a table of values, its friction as one curve, evidence and rivals folded."""
    rows, details = [], ""
    for finding in findings:
        name = words(finding.name)
        title = f"{name[:1].upper() + name[1:]} at {finding.at}"
        cells = [escape(title), chance(finding.probability)]
        for parameter, estimate in finding.parameters.items():
            value, std = with_std(estimate.value, estimate.std)
            unit = escape(unit_words(estimate.unit)) or "–"
            mark = flag("at its bound") if estimate.at_bound else ""
            rows.append([*cells, escape(words(parameter)), value, f"± {std}", unit, mark])
            cells = ["", ""]
        if not finding.parameters:
            rows.append([*cells, "", "–", "–", "–", ""])
        details += folded(f"Why {name} at {finding.at}", paragraph(finding.evidence) + _rivals(finding.rivals))
    heads = ["Effect", "Probability", "Parameter", "Value", "Deviation", "Unit", ""]
    found = table(f"Found at {place}", heads, rows, (1, 3, 4), False)
    if curve and any(finding.name in curve.effects for finding in findings):
        text = friction_words(curve)
        found += figure(friction_over_speed(curve), text, f"{text} Band: two standard deviations.", small=True)
    return f'<article class="card"><h3>{escape(place)}</h3>\n{found}{details}</article>\n'


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
