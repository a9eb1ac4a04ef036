"""The report's later parts: held-out data, the steps, the residual's shape, candidates, parameters, notes."""

from collections.abc import Sequence
from html import escape

import numpy as np

from ...report.drawing import AFTER, BEFORE
from ...report.html import figure, flag, folded, paragraph, table
from ...report.strips import Curve, Strip
from ...report.words import number, percent, unit_words, with_std, words
from ...report.zoom import zoomable
from ..diagnosis import Array, Diagnosis, Trace
from .curves import residual_curves
from .figures import before_and_after, candidates, steps
from .findings import detection_limits

_OPEN = 4
_TOP = 15
_MOVED = 2.0


def most_changed(diagnosis: Diagnosis) -> list[Trace]:
    """One trace a channel, held-out where there is one; the headline's channel first, then what changed most.

    Of several recordings, the one on which the channel changed most.
    """
    return [max(_shown(diagnosis, channel), key=_change) for channel in _channels(diagnosis)]


def comparison(diagnosis: Diagnosis, trace: Trace) -> tuple[bool, str]:
    """Whether the model changed on a channel, and its picture: measurement and model above, residual below."""
    changed = changes([trace])
    models = "model before and model after" if changed else "model"
    text = f"{trace.channel} in {trace.recording}: measured, {models} over time, and the residual below."
    return changed, figure(
        before_and_after(trace, changed),
        text,
        f"{trace.channel} in {trace.recording} ({_ROLE[trace.role]}). {_alike(diagnosis, changed)}Right: where the "
        + ("two models differ most." if changed else "model misses most."),
        zoom=zoomable(_strips(trace, changed), text),
    )


def unseen(diagnosis: Diagnosis, skip: int = 0) -> tuple[str, str, str]:
    """Measurement and model on held-out data, most changed channels first but for ``skip``, and the table of RMS."""
    pictures = [comparison(diagnosis, trace) for trace in most_changed(diagnosis)[skip:]]
    added = bool(diagnosis.effects)
    title = "Before and after, on held-out data" if added else "Model and measurement, on held-out data"
    return "unseen", title, _open_and_folded(pictures) + _misfits(diagnosis, added)


def step_by_step(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """The model step by step, with its misfit on both sets."""
    rows = [[escape(step.label), percent(step.train, 3), percent(step.holdout, 3)] for step in diagnosis.steps]
    heads = ["Model", "Training", "Held-out"]
    content = table("Relative misfit over all channels", heads, rows, numeric=(1, 2), wide=False)
    if len(diagnosis.steps) > 1:
        first, last = diagnosis.steps[0], diagnosis.steps[-1]
        content += figure(
            steps(diagnosis.steps),
            f"Relative misfit by step; on the held-out recording from {percent(first.holdout, 3)} to "
            f"{percent(last.holdout, 3)}.",
            "Each step keeps the effects above it and fits everything again.",
            small=True,
        )
    return "steps", "Step by step", content


def shape(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Residual against speed and position, channel by channel."""
    pictures = []
    for channel in _channels(diagnosis):
        traces = _shown(diagnosis, channel)
        changed = changes(traces)
        drawn = residual_curves(traces, changed)
        if drawn is None:
            continue
        picture = figure(
            drawn,
            f"{channel}: residual{' before and after' if changed else ''} against speed and position.",
            f"{channel}, {_ROLE[traces[0].role]}. {_alike(diagnosis, changed)}Line: mean in bins; band: one standard "
            "deviation either side; points: samples (the outermost 0.1 % may lie outside the picture).",
        )
        pictures.append((changed, picture))
    content = _open_and_folded(pictures) or paragraph("No channel has a position or speed to draw against.")
    return "shape", "Residual against speed and position", content


def screened(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """What each candidate explains by itself on top of the baseline."""
    rows = diagnosis.candidates
    heading = "What each candidate explains by itself"
    if not rows:
        return "candidates", heading, paragraph("No candidate was tried: the residual gave no reason for one.")
    top = sorted(rows, key=lambda row: -row.explained)[:_TOP]
    named = ", ".join(f"{words(row.name)} at {row.at}" for row in top if row.named)
    content = figure(
        candidates(top),
        f"Share of residual energy explained by each of the best {len(top)} candidates"
        + (f"; named in the end: {named}." if named else "; none was named."),
        "Each candidate alone, with the baseline fitted again. They overlap, so the shares do not add up"
        + (": a candidate that explains much may only imitate one that was named." if named else "."),
        small=True,
    )
    cells = [
        [
            escape(words(row.name)),
            escape(row.at),
            percent(row.explained, 3),
            number(row.score),
            "named" if row.named else "",
        ]
        for row in rows
    ]
    every = table(
        "Each effect by itself", ["Effect", "At", "Explained", "Score", ""], cells, numeric=(2, 3), wide=False
    )
    return "candidates", heading, content + folded(f"All {len(rows)} candidates as a table", every)


def parameters(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Baseline parameters before and after the missing physics was added."""
    heading = "Which baseline parameters moved"
    if not diagnosis.moved:
        return "parameters", heading, paragraph("None: no physics was added to the baseline.")
    rows = []
    for moved in diagnosis.moved:
        after, std = with_std(moved.after, moved.std)
        before, _ = with_std(moved.before, moved.std)
        far = abs(moved.after - moved.before) > _MOVED * moved.std
        rows.append(
            [
                escape(moved.name),
                before,
                after,
                f"± {std}",
                escape(unit_words(moved.unit)) or "–",
                flag("moved") if far else "",
            ]
        )
    heads = ["Parameter", "Before", "After", "Std", "Unit", ""]
    lead = (
        "A parameter that moves had imitated the missing physics. Marked: moved by more than two standard deviations."
    )
    return "parameters", heading, paragraph(lead) + table("Baseline parameters", heads, rows, (1, 2, 3), False)


def notes(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Conditioning and excitation in words; the limits of detection, folded, unless they were shown already."""
    items = "".join(f"<li>{escape(note)}</li>\n" for note in diagnosis.notes)
    content = f"<ul>{items}</ul>\n" if items else ""
    if diagnosis.verdict != "adequate":
        limits = detection_limits(diagnosis)
        content += folded("The smallest effects that would have been seen", limits) if diagnosis.limits else limits
    return "notes", "Notes", content or paragraph("No remarks on conditioning or excitation.")


_ROLE = {"train": "training", "holdout": "held-out"}


def _strips(trace: Trace, changed: bool) -> list[Strip]:
    models = [("model before", trace.before, BEFORE), ("model after", trace.after, AFTER)]
    if not changed:
        models = [("model", trace.before, AFTER)]
    unit = unit_words(trace.unit)
    measured = Curve("measured", trace.time, trace.measured, "ink")
    lines = [Curve(label, trace.time, values, colour) for label, values, colour in models]
    left = [Curve("", trace.time, trace.measured - values, colour) for _, values, colour in models]
    above = Strip(f"{trace.channel}, {trace.recording}", unit, [measured, *lines], recording=trace.recording)
    return [above, Strip("residual", unit, left, recording=trace.recording)]


def _shown(diagnosis: Diagnosis, channel: str) -> list[Trace]:
    """A channel's held-out traces, or those of training where no other was kept."""
    traces = [trace for trace in diagnosis.traces if trace.channel == channel]
    return [trace for trace in traces if trace.role == "holdout"] or traces


def _channels(diagnosis: Diagnosis) -> list[str]:
    """Channels with traces: the one that the headline speaks of, then those whose residual changed most."""
    names = dict.fromkeys(trace.channel for trace in diagnosis.traces)

    def rank(name: str) -> tuple[bool, tuple[float, float]]:
        return name == diagnosis.foremost, max(map(_change, _shown(diagnosis, name)))

    return sorted(names, key=rank, reverse=True)


def _change(trace: Trace) -> tuple[float, float]:
    """Drop of the residual's RMS, and its RMS before, both relative to the measurement's."""
    scale = _rms(trace.measured) or 1.0
    before, after = _rms(trace.measured - trace.before), _rms(trace.measured - trace.after)
    return (before - after) / scale, before / scale


def changes(traces: Sequence[Trace]) -> bool:
    """Whether the model's change is worth drawing twice: over a hundredth of the residual's RMS."""
    return any(_rms(t.after - t.before) > 0.01 * _rms(t.measured - t.before) for t in traces)


def _alike(diagnosis: Diagnosis, changed: bool) -> str:
    return "The model before and after are alike here. " if diagnosis.effects and not changed else ""


def _rms(signal: Array) -> float:
    finite = signal[np.isfinite(signal)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0


def _open_and_folded(pictures: Sequence[tuple[bool, str]]) -> str:
    """Pictures of the channels that changed (of any, where none did) open, four at most; the others folded."""
    ordered = sorted(pictures, key=lambda p: not p[0])
    open_ones = min(_OPEN, sum(changed for changed, _ in pictures) or _OPEN)
    rest = len(pictures) - open_ones
    markup = [picture for _, picture in ordered]
    label = f"{rest} more channel{'s' if rest > 1 else ''}"
    return "".join(markup[:open_ones]) + folded(label, "".join(markup[open_ones:]))


def _misfits(diagnosis: Diagnosis, added: bool) -> str:
    columns: list[tuple[str, list[str]]] = []
    for name, said in (("train", "training"), ("holdout", "held-out")):
        misfits = [getattr(fit, name) for fit in diagnosis.fit]
        columns.append((f"RMS, {said}" + ", before" * added, [number(m.rms_before) for m in misfits]))
        columns += [(f"RMS, {said}, after", [number(m.rms_after) for m in misfits])] * added
    columns.append(("Noise floor", [number(fit.noise_floor) for fit in diagnosis.fit]))
    unseen = [fit.holdout for fit in diagnosis.fit]
    columns.append(("Relative, held-out" + ", before" * added, [percent(m.relative_before, 3) for m in unseen]))
    columns += [("Relative, held-out, after", [percent(m.relative_after, 3) for m in unseen])] * added
    names = [f"{escape(fit.channel)}\u00a0[{escape(unit_words(fit.unit))}]" for fit in diagnosis.fit]
    heads = ["Channel", *(head for head, _ in columns)]
    rows = list(zip(names, *(cells for _, cells in columns), strict=True))
    caption = "RMS of the residual in the channel's unit; relative means over the RMS of the measurement"
    return table(caption, heads, rows, numeric=range(1, len(heads)))
