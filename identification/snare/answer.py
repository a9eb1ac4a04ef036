"""The search's findings in captures, in words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ...models.model import Model
from ...models.snare.setup import APPLIED, SnareTree
from ...report.words import percent
from ..diagnosis import (
    Candidate,
    ChannelFit,
    Diagnosis,
    Estimate,
    Finding,
    Limit,
    Misfit,
    ParameterShift,
    Rival,
    Step,
    Trace,
)
from ..reliability import probability as reliability
from ..verdict import verdict
from ..wording import experiment_sentence, foremost, named, rejection
from .channels import channel_errors, channels, modelled
from .comparison import QUARTER, SLOW, variances
from .fit import CaptureFit, spread
from .handles import bounds, handle_of, key_of
from .library import absent
from .locate import locate_capture
from .recording import CaptureRecording
from .search import CaptureNaming, CaptureSelection

BAND = 1 / (2 * QUARTER)
"""[Hz] What means over a quarter of a second hold."""
LEFT_OVER = 0.25
"""A model without anything to name that leaves this share of the motion is told to miss something, ..."""
VISIBLE = 1e-3
"""... if that is 1 mm, too [m]."""
LIKELY = 0.005
"""A rival that is less probable is not listed, where the recordings tell it apart."""


def report_on(
    model: Model,
    found: CaptureSelection,
    train: Sequence[CaptureRecording],
    locked: Sequence[CaptureRecording],
    seconds: float,
    runs: int,
) -> Diagnosis:
    """Put everything into words and numbers.

    Parameters
    ----------
    model : Model
        As it was.
    found : CaptureSelection
    train, locked : sequences of CaptureRecording
    seconds, runs : float, int
        What the search took [s], and the simulations in it.
    """
    fits = _fits(found, train, locked)
    findings = tuple(_finding(n, found, train, locked) for n in found.named if n.trial.placed.effect.name in APPLIED)
    corrected = [
        f"{p.effect.name} = {found.last.values[key_of(p)]:.4g} {p.effect.parameters[0].unit}"
        for p in found.last.placed
        if p.effect.name not in APPLIED
    ]
    unexplained = () if findings else _unexplained(fits)
    description = _unexplained_words(unexplained)
    notes = [f"{Path(c.path).name}: {note}" for c in (*train, *locked) for note in c.notes]
    notes += [rejection(p) for p in found.rejected]
    notes += [
        "positions and forces are compared as means over 0.25 s, and the force's chatter by its size: "
        "how cables chatter on the pin depends on every detail",
        f"{runs} captures were simulated in {seconds:.0f} s",
    ]
    keys = {n.trial.placed.key for n in found.named}
    candidates = tuple(
        Candidate(t.placed.effect.name, t.placed.at, float(t.explained), float(t.score), t.placed.key in keys)
        for t in sorted(found.opening, key=lambda t: -t.explained)
        if np.isfinite(t.score)
    )
    return Diagnosis(
        verdict(findings, unexplained),
        _sentence(findings, fits, description) + _corrected(corrected),
        description,
        model.name,
        findings,
        locate_capture(found, train),
        fits,
        _steps(found, train, locked),
        candidates,
        _moved(model, found, train),
        _traces(found, train, locked),
        _limits(model, found, train),
        tuple(notes),
        BAND,
        foremost=_foremost(findings, fits).channel,
    )


def estimates(captures: Sequence[CaptureRecording], found: CaptureFit) -> dict[str, dict[str, Estimate]]:
    """Parameters by the effect's key and their own name."""
    low, high = bounds(found.placed)
    std = spread(captures, found)
    made: dict[str, dict[str, Estimate]] = {}
    for p, x, s, a, b in zip(found.placed, found.x, std, low, high, strict=True):
        (parameter,) = p.effect.parameters
        bound = bool(min(x - a, b - x) < 1e-6 * handle_of(p).step)
        made[p.key] = {parameter.name: Estimate(found.values[key_of(p)], float(s), parameter.unit, bound)}
    return made


def _finding(
    named: CaptureNaming, found: CaptureSelection, train: Sequence[CaptureRecording], locked: Sequence[CaptureRecording]
) -> Finding:
    placed = named.trial.placed
    right = reliability(named.margin)
    rivals = tuple(
        Rival(
            r.placed.effect.name,
            r.placed.at,
            r.probability * right,
            r.separable,
            experiment_sentence(placed, r.placed),
        )
        for r in named.rivals
        if r.probability >= LIKELY or not r.separable
    )
    pairs = zip(channel_errors(locked, named.held_before), channel_errors(locked, named.held_after), strict=True)
    before, after = max(pairs, key=lambda e: e[0].relative - e[1].relative)
    what = placed.effect.sentence
    evidence = (
        f"{what[:1].upper()}{what[1:]}: it explains {percent(named.trial.explained)} of the remaining residual. "
        f"Without it, the error of {before.channel} on the held-out capture rises from "
        f"{_size(after.rms, after.unit)} to {_size(before.rms, before.unit)}."
    )
    values = estimates(train, found.last)[placed.key]
    return Finding(placed.effect.name, placed.at, named.margin, named.margin * right, values, evidence, rivals)


def _size(value: float, unit: str) -> str:
    return f"{1e3 * value:.3g} mm" if unit == "m" else f"{value:.3g} {unit}"


def _fits(
    found: CaptureSelection, train: Sequence[CaptureRecording], locked: Sequence[CaptureRecording]
) -> tuple[ChannelFit, ...]:
    fitted = _misfits(train, found.first, found.last)
    held = _misfits(locked, found.held_first, found.held_last)
    made = []
    for name, (unit, misfit) in fitted.items():
        if name not in held:
            continue
        body = next((b for b, s in train[0].sensors.items() if name.startswith(f"force.{s}.")), "position")
        noise = train[0].noise[body] / SLOW**0.5
        made.append(ChannelFit(name, unit, misfit, held[name][1], float(noise)))
    return tuple(made)


def _misfits(
    captures: Sequence[CaptureRecording], before: CaptureFit, after: CaptureFit
) -> dict[str, tuple[str, Misfit]]:
    """Unit and misfits by channel."""
    pairs = zip(channel_errors(captures, before), channel_errors(captures, after), strict=True)
    return {a.channel: (a.unit, Misfit(a.rms, b.rms, a.relative, b.relative)) for a, b in pairs}


def _unexplained(fits: Sequence[ChannelFit]) -> tuple[ChannelFit, ...]:
    """Channels of a motion that remains without a name: more than `LEFT_OVER` of the largest, and `VISIBLE`."""
    positions = [f for f in fits if f.unit == "m"]
    largest = max(f.holdout.rms_before / max(f.holdout.relative_before, 1e-12) for f in positions)
    least = max(LEFT_OVER * largest, VISIBLE)
    return tuple(f for f in positions if f.train.rms_after > least and f.holdout.rms_after > VISIBLE)


def _unexplained_words(channels: Sequence[ChannelFit]) -> str:
    if not channels:
        return ""
    sizes = " and ".join(f"{_size(f.train.rms_after, 'm')} of {f.channel}" for f in channels)
    return f"{sizes} remain that no effect of a capture explains: check the set-up's sizes and masses"


def _foremost(findings: Sequence[Finding], fits: Sequence[ChannelFit]) -> ChannelFit:
    """What the sentence speaks of: the channel that names made best, or the motion that is told worst."""
    if findings:
        return foremost(findings, fits)
    return max((f for f in fits if f.unit == "m"), key=lambda f: f.holdout.rms_before)


def _sentence(findings: Sequence[Finding], fits: Sequence[ChannelFit], description: str) -> str:
    worst = _foremost(findings, fits)
    if findings:
        return (
            f"The model leaves out {named(findings)}. With that added, the error of {worst.channel} on the held-out "
            f"capture falls from {_size(worst.holdout.rms_before, worst.unit)} to "
            f"{_size(worst.holdout.rms_after, worst.unit)}."
        )
    if description:
        return f"Something is missing that no effect of the vocabulary explains: {description}."
    return (
        "The model is adequate: these captures show nothing that it leaves out. On the held-out capture, "
        f"the error of {worst.channel} is {_size(worst.holdout.rms_before, worst.unit)}."
    )


def _corrected(numbers: Sequence[str]) -> str:
    if not numbers:
        return ""
    return f" Numbers of the set-up that the model file does not give fit better as {', '.join(numbers)}."


def _relative(captures: Sequence[CaptureRecording], found: CaptureFit) -> float:
    """RMS over motion and force of what is left, each relative to all of its kind."""
    shares = []
    errors = channel_errors(captures, found)
    for unit in {e.unit for e in errors}:
        left = sum(e.rms**2 for e in errors if e.unit == unit)
        whole = sum(e.reference**2 for e in errors if e.unit == unit)
        shares.append(left / max(whole, 1e-300))
    return float(np.sqrt(np.mean(shares)))


def _steps(
    found: CaptureSelection, train: Sequence[CaptureRecording], locked: Sequence[CaptureRecording]
) -> tuple[Step, ...]:
    lines = [Step("model as given", _relative(train, found.first), _relative(locked, found.held_first))]
    for n in found.named:
        label = f"+ {n.trial.placed.effect.name} at {n.trial.placed.at}"
        lines.append(Step(label, _relative(train, n.trial.fit), _relative(locked, n.held_after)))
    return tuple(lines)


def _moved(model: Model, found: CaptureSelection, train: Sequence[CaptureRecording]) -> tuple[ParameterShift, ...]:
    after = estimates(train, found.last)
    made = []
    for n in found.named:
        p = n.trial.placed
        if p.effect.name not in APPLIED:
            (now,) = after[p.key].values()
            usual = handle_of(p).value(absent(model, p))
            made.append(ParameterShift(f"capture.{p.effect.name}", now.unit, usual, now.value, now.std))
    for p, x in zip(found.first.placed, found.first.x, strict=True):
        (now,) = after[p.key].values()
        made.append(ParameterShift(key_of(p), now.unit, handle_of(p).value(float(x)), now.value, now.std))
    return tuple(made)


def _traces(
    found: CaptureSelection, train: Sequence[CaptureRecording], locked: Sequence[CaptureRecording]
) -> tuple[Trace, ...]:
    made = []
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[CaptureRecording], CaptureFit, CaptureFit], ...] = (
        ("train", train, found.first, found.last),
        ("holdout", locked, found.held_first, found.held_last),
    )
    for role, captures, before, after in sets:
        for c, old, new in zip(captures, before.tracks, after.tracks, strict=True):
            for channel, a, b in zip(channels(c), modelled(c, old), modelled(c, new), strict=True):
                known = np.isfinite(channel.measured) & np.isfinite(channel.place)
                speed = np.gradient(channel.place, channel.times)
                columns = (x[known] for x in (channel.times, channel.place, speed, channel.measured, a, b))
                made.append(Trace(Path(c.path).name, role, channel.name, channel.unit, *columns))
    return tuple(made)


def _limits(model: Model, found: CaptureSelection, train: Sequence[CaptureRecording]) -> tuple[Limit, ...]:
    """Smallest value of each effect that would have been seen: what it changes grows in proportion to its handle."""
    named = {n.trial.placed.key for n in found.named}
    by = variances(train, found.last.residuals)
    made = []
    for t in found.opening:
        if t.placed.key in named or t.placed.effect.name not in APPLIED or not t.fit.residuals:
            continue
        handle = handle_of(t.placed)
        start = absent(model, t.placed)
        moved = float(t.fit.x[-1]) - start
        # What it changes, its handle moved so far; what was there stands where it is best with it.
        pairs = zip(found.first.residuals, t.fit.residuals, strict=True)
        energy = sum(0.5 * float(np.sum((a[k] - b[k]) ** 2)) / by[k] for a, b in pairs for k in a)
        if abs(moved) < 1e-9 or energy <= 0:
            continue
        x = start + moved * float(np.sqrt(found.bar / energy))
        if handle.low <= x <= handle.high:
            effect, value = t.placed.effect, float(handle.value(x))
            (parameter,) = effect.parameters
            made.append(Limit(effect.name, t.placed.at, parameter.name, value, parameter.unit))
    return tuple(made)


def with_found(model: Model, found: CaptureFit) -> Model:
    """The model with what was found: effects, their values, and numbers of the set-up."""
    assert isinstance(model.tree, SnareTree)
    placed = tuple(p for p in found.placed if p.effect.name in APPLIED)
    values = {key_of(p): found.values[key_of(p)] for p in placed}
    tree = replace(model.tree, setup=model.tree.setup.corrected(found.values))
    return replace(model, tree=tree, effects=placed, values={**model.values, **values})
