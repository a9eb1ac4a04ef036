"""The decision on dockings in words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..diagnosis import Diagnosis, Estimate, Location, ParameterShift, Step, Trace
from ..sources.answer import candidates, channel_fits, estimates, finding, limits, not_confirmed, rms
from ..sources.decide import SourceDecision
from ..sources.source import Linearisation, ModelPoint
from ..sources.stages import stages
from ..sources.weigh import covariances
from ..wording import foremost, named
from .recording import EVERY, DockingRecording, unit_of
from .runs import SHIFTS
from .source import Dockings

Array = NDArray[np.float64]

BAND = 1 / (2 * EVERY)
"""[Hz] What means over a window hold."""
MOST_WINDOWS = 6
LEAST = 0.01
"""Share of what changed below which a channel is not listed."""


def report_on(source: Dockings, name: str, decided: SourceDecision, seconds: float) -> Diagnosis:
    """Put everything into words and numbers; ``name`` is the model's."""
    found, best, records = decided.found, decided.best, source.records
    own, locked = ([records[i] for i in some] for some in (source.train, source.held))
    sizes = source.sizes(source.train), source.sizes(source.held)
    values = estimates(source, decided.given, decided.train, covariances(found.weighed))
    findings = []
    for n in best.names:
        p = n.placed
        a, b, unit, channel = _worst(locked, best.missed[p.key].fit.held, decided.held, sizes[1])
        what = p.effect.sentence
        evidence = (
            f"{what[:1].upper()}{what[1:]}: the recordings are e^{n.gain:.0f} times likelier with it. Without it, "
            f"the error of {channel} on the held-out docking rises from {_size(b, unit)} to {_size(a, unit)}."
        )
        findings.append(finding(decided, n, values[p.key], evidence, max(0.0, 1 - (b / max(a, 1e-300)) ** 2)))
    units = [unit_of(c) for c in source.channels]
    fits = channel_fits(decided, source.channels, units, *sizes, [float(n.white) for n in found.weighed.noises])
    worst = foremost(findings, fits)
    if findings:
        sentence = (
            f"The model leaves out {named(findings)}. With that added, the error of {worst.channel} on the held-out "
            f"docking falls from {_size(worst.holdout.rms_before, worst.unit)} to "
            f"{_size(worst.holdout.rms_after, worst.unit)}."
        )
    else:
        sentence = "The model is adequate: these dockings show no named effect that it leaves out."
    notes = [f"{Path(r.path).name}: {note}" for r in records for note in r.notes] + not_confirmed(decided)
    shifts = ", ".join(f"{k} {x:+.1f}" for k, x in zip(SHIFTS, decided.train.at.shifts, strict=True) if abs(x) > 1)
    notes.append(
        f"numbers of the set-up moved within their tolerances, in deviations: {shifts or 'none by one or more'}"
    )
    notes.append(f"{source.count} dockings were simulated in {seconds:.0f} s")
    return Diagnosis(
        decided.verdict, sentence, "", name, tuple(findings),
        _locations(own[0], decided), fits, _steps(source, decided, sizes), candidates(decided),
        _moved(decided.given, values), _traces(own, locked, decided), limits(source, decided), tuple(notes), BAND,
        foremost=worst.channel,
    )  # fmt: skip


def _worst(
    records: Sequence[DockingRecording], without: Linearisation, within: Linearisation, size: Array
) -> tuple[float, float, str, str]:
    """RMS without and with an effect, unit and name of the channel that misses it most."""
    a, b = rms(without), rms(within)
    c = int(np.argmax((a - b) / size))
    channel = records[0].channels[c]
    return float(a[c]), float(b[c]), unit_of(channel), channel


def _size(value: float, unit: str) -> str:
    factor, word = {"m": (1e6, "um"), "rad": (1e3, "mrad")}.get(unit, (1.0, unit))
    return f"{factor * value:.3g} {word}"


def _steps(source: Dockings, decided: SourceDecision, sizes: tuple[Array, Array]) -> tuple[Step, ...]:
    return tuple(
        Step(label, *(float(np.sqrt(np.mean((rms(x) / s) ** 2))) for x, s in zip(fits, sizes, strict=True)))
        for label, *fits in stages(source, decided)
    )


def _moved(given: ModelPoint, values: dict[str, dict[str, Estimate]]) -> tuple[ParameterShift, ...]:
    before = given.all_values
    return tuple(
        ParameterShift(f"{key}.{name}", e.unit, before[f"{key}.{name}"], e.value, e.std)
        for key, own in values.items()
        for name, e in own.items()
        if f"{key}.{name}" in before
    )


def _locations(record: DockingRecording, decided: SourceDecision) -> tuple[Location, ...]:
    """Channels by the share of what the names changed, or of what is left, each in units of its noise."""
    first, last, found = decided.found.first.train, decided.train, decided.found
    named_any = len(last.at.placed) > len(first.at.placed)
    change = first.residuals[0] - last.residuals[0] if named_any else last.residuals[0]
    noise = np.array([max(n.white, 1e-12) for n in found.weighed.noises])
    energy = np.sum((change / noise) ** 2, axis=0)
    total = float(energy.sum())
    made = []
    for c in np.argsort(-energy):
        if total <= 0 or energy[c] < LEAST * total:
            break
        windows = _windows(record, change[:, c])
        begun = record.motion.latch[0]
        after = float(np.sum(change[record.times[:-1] >= begun, c] ** 2) / max(np.sum(change[:, c] ** 2), 1e-300))
        where = "throughout the docking"
        if after > 0.9:
            where = f"once the latches close, from {record.zero + begun:.1f} s on"
        elif after < 0.1 and begun < record.times[-1]:
            where = f"before the latches close, until {record.zero + begun:.1f} s"
        made.append(Location(record.channels[c], float(energy[c] / total), windows, where))
    return tuple(made)


def _windows(record: DockingRecording, change: Array) -> tuple[tuple[float, float], ...]:
    """Half seconds that hold the strongest half of a change, neighbours merged."""
    size = round(0.5 / EVERY)
    energy = np.bincount(np.arange(len(change)) // size, change**2)
    order = np.argsort(-energy)
    count = int(np.searchsorted(np.cumsum(energy[order]), 0.5 * energy.sum())) + 1
    chosen = np.zeros(len(energy) + 2, bool)
    chosen[order[:count] + 1] = True
    edges = np.flatnonzero(np.diff(chosen.astype(int)))
    end = len(record.times) - 1
    spans = [
        (record.times[size * a], record.times[min(size * b, end)]) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    return tuple((round(float(a + record.zero), 3), round(float(b + record.zero), 3)) for a, b in spans[:MOST_WINDOWS])


def _traces(
    train: Sequence[DockingRecording], held: Sequence[DockingRecording], decided: SourceDecision
) -> tuple[Trace, ...]:
    made = []
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[DockingRecording], Linearisation, Linearisation], ...] = (
        ("train", train, decided.found.first.train, decided.train),
        ("holdout", held, decided.before, decided.held),
    )
    for role, records, before, after in sets:
        for r, a, b in zip(records, before.residuals, after.residuals, strict=True):
            middle = 0.5 * (r.times[1:] + r.times[:-1])
            place, speed = (np.interp(middle, r.motion.times, x) for x in (r.motion.travel, r.motion.rate))
            for c, channel in enumerate(r.channels):
                own = r.measured[:, c]
                known = np.isfinite(own)
                columns = (x[known] for x in (middle + r.zero, place, speed, own, own - a[:, c], own - b[:, c]))
                made.append(Trace(Path(r.path).name, role, channel, unit_of(channel), *columns))
    return tuple(made)
