"""What a decision says of captures, in words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ...models.snare.setup import APPLIED, NUMBERS, SnareTree
from ..decision.selection import Naming, Remainder
from ..diagnosis import ChannelFit, Diagnosis, Estimate, Finding, ParameterShift, Step, Trace
from ..sources.answer import candidates, channel_fits, estimates, finding, limits, not_confirmed, rms
from ..sources.answer import with_found as with_effects
from ..sources.decide import SourceDecision
from ..sources.source import Linearisation, ModelPoint
from ..sources.stages import stages
from ..sources.weigh import covariances
from ..verdict import verdict
from ..wording import foremost, listed, named
from .locate import locate_capture
from .seen import QUARTER, SLOW, shown, times, unit_of
from .source import Captures

Array = NDArray[np.float64]

BAND = 1 / (2 * QUARTER)
"""[Hz] What means over a quarter of a second hold."""


def report_on(source: Captures, decided: SourceDecision, seconds: float) -> Diagnosis:
    """Put everything into words and numbers; ``seconds``: what the search took."""
    best, model = decided.best, source.model
    values = estimates(source, decided.given, decided.train, covariances(decided.found.weighed))
    fits = _fits(source, decided)
    findings = tuple(_finding(source, decided, n, values) for n in best.names if n.placed.effect.name in APPLIED)
    description = "" if findings else _left(source, decided)
    moved = _moved(source, decided, values)
    notes = [f"{Path(r.path).name}: {note}" for r in source.records for note in r.notes] + not_confirmed(decided)
    notes += [
        "positions and forces are compared as means over 0.25 s, and the force's chatter by its size: "
        "how cables chatter on the pin depends on every detail",
        f"{source.runs.count} captures were simulated in {seconds:.0f} s",
    ]
    foremost_fit = _foremost(findings, fits)
    return Diagnosis(
        verdict(findings, () if findings else decided.left.curves),
        _sentence(findings, foremost_fit, description) + _corrected(moved),
        description,
        model.name,
        findings,
        locate_capture(source, decided),
        fits,
        _steps(source, decided),
        candidates(decided),
        moved,
        _traces(source, decided),
        tuple(x for x in limits(source, decided) if x.name in APPLIED),
        tuple(notes),
        BAND,
        foremost=foremost_fit.channel,
    )


def _fits(source: Captures, decided: SourceDecision) -> tuple[ChannelFit, ...]:
    units = [unit_of(name) for name in source.channels]
    noise = source.records[0].noise
    bodies = {sensor: body for body, sensor in source.records[0].sensors.items()}
    floors = [noise.get(bodies.get(n.split(".")[1], "position"), 0.0) / SLOW**0.5 for n in source.channels]
    every = channel_fits(decided, source.channels, units, source.sizes(source.train), source.sizes(source.held), floors)
    return tuple(every[c] for c in shown(source.channels))


def _finding(
    source: Captures, decided: SourceDecision, n: Naming, values: Mapping[str, Mapping[str, Estimate]]
) -> Finding:
    p, held = n.placed, decided.held
    without, size = rms(decided.best.missed[p.key].fit.held), source.sizes(source.held)
    within = rms(held)
    c = max(shown(source.channels), key=lambda c: (without[c] - within[c]) / size[c])
    channel, what = source.channels[c], p.effect.sentence
    evidence = (
        f"{what[:1].upper()}{what[1:]}: the recordings are e^{n.gain:.0f} times likelier with it. Without it, the "
        f"error of {channel} on the held-out capture rises from {_size(within[c], unit_of(channel))} to "
        f"{_size(without[c], unit_of(channel))}."
    )
    explained = max(0.0, 1 - float(within[c] / max(without[c], 1e-300)) ** 2)
    return finding(decided, n, values[p.key], evidence, explained)


def _size(value: float, unit: str) -> str:
    return f"{1e3 * value:.3g} mm" if unit == "m" else f"{value:.3g} {unit}"


def _left(source: Captures, decided: SourceDecision) -> str:
    """What nameless curves say, in words."""
    if not decided.left.curves:
        return ""
    left = rms(decided.train)

    def told(r: Remainder) -> str:
        name = source.channels[r.channel]
        unit = unit_of(name)
        size = f"a share of e^{left[r.channel]:.2g}" if unit == "1" else _size(left[r.channel], unit)
        return f"{size} of {name}, over {r.over}"

    return f"{listed([told(r) for r in decided.left.curves])} remain that no effect of a capture explains: check the " \
        "set-up's sizes and masses"  # fmt: skip


def _foremost(findings: Sequence[Finding], fits: Sequence[ChannelFit]) -> ChannelFit:
    """What the sentence speaks of: the channel that names made best, or the motion that is told worst."""
    if findings:
        return foremost(findings, fits)
    return max((f for f in fits if f.unit == "m"), key=lambda f: f.holdout.rms_before)


def _sentence(findings: Sequence[Finding], worst: ChannelFit, description: str) -> str:
    before, after = (_size(x, worst.unit) for x in (worst.holdout.rms_before, worst.holdout.rms_after))
    if findings:
        return (
            f"The model leaves out {named(findings)}. With that added, the error of {worst.channel} on the held-out "
            f"capture falls from {before} to {after}."
        )
    if description:
        return f"Something is missing that no effect of the vocabulary explains: {description}."
    return (
        "The model is adequate: these captures show nothing that it leaves out. On the held-out capture, "
        f"the error of {worst.channel} is {before}."
    )


def _corrected(moved: Sequence[ParameterShift]) -> str:
    own = [
        f"{m.name.removeprefix('capture.')} = {m.after:.4g} {m.unit}" for m in moved if m.name.startswith("capture.")
    ]
    if not own:
        return ""
    return f" Numbers of the set-up that the model file does not give fit better as {', '.join(own)}."


def _steps(source: Captures, decided: SourceDecision) -> tuple[Step, ...]:
    def share(linear: Linearisation, numbers: Sequence[int]) -> float:
        """RMS over motion and force of what is left, each relative to all of its kind."""
        left, size = rms(linear) ** 2, source.sizes(numbers) ** 2
        units = [unit_of(name) for name in source.channels]
        kinds = [[c for c in shown(source.channels) if units[c] == unit] for unit in ("m", "N") if unit in units]
        return float(np.sqrt(np.mean([left[own].sum() / max(float(size[own].sum()), 1e-300) for own in kinds])))

    return tuple(
        Step(label, share(train, source.train), share(held, source.held))
        for label, train, held in stages(source, decided)
    )


def _moved(
    source: Captures, decided: SourceDecision, values: Mapping[str, Mapping[str, Estimate]]
) -> tuple[ParameterShift, ...]:
    """Numbers of the set-up that were found to be others, then parameters that the model had."""
    made = []
    for n in decided.best.names:
        if n.placed.effect.name in NUMBERS:
            (now,) = values[n.placed.key].values()
            made.append(ParameterShift(f"capture.{n.placed.effect.name}", now.unit, source.origin(n.placed), now.value,
                                       now.std))  # fmt: skip
    before = decided.given.all_values
    for p in decided.given.placed:
        for name, now in values[p.key].items():
            made.append(ParameterShift(f"{p.key}.{name}", now.unit, before[f"{p.key}.{name}"], now.value, now.std))
    return tuple(made)


def _traces(source: Captures, decided: SourceDecision) -> tuple[Trace, ...]:
    made = []
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[int], Linearisation, Linearisation], ...] = (
        ("train", source.train, decided.found.first.train, decided.train),
        ("holdout", source.held, decided.before, decided.held),
    )
    for role, numbers, before, after in sets:
        for i, a, b in zip(numbers, before.residuals, after.residuals, strict=True):
            record, measured = source.records[i], source.measured(i)
            for c in shown(source.channels):
                own, place = measured[:, c], measured[:, "xyz".index(source.channels[c][-1])]
                known = np.isfinite(own) & np.isfinite(place)
                time = times(record)
                speed = np.gradient(place, time)
                columns = (x[known] for x in (time, place, speed, own, own - a[:, c], own - b[:, c]))
                made.append(Trace(Path(record.path).name, role, source.channels[c], unit_of(source.channels[c]),
                                  *columns))  # fmt: skip
    return tuple(made)


def with_found(model: Model, at: ModelPoint) -> Model:
    """The model with what was found: effects, their values, and numbers of the set-up."""
    tree = model.tree_as(SnareTree)
    tree = replace(tree, setup=tree.setup.corrected(at.all_values))
    effects = [p.key for p in at.placed if p.effect.name in NUMBERS]
    return replace(with_effects(model, at.without(*effects)), tree=tree)
