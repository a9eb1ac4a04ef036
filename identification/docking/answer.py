"""What a search found in dockings, in words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..deciding import CLASS
from ..diagnosis import (
    Candidate,
    ChannelFit,
    Diagnosis,
    Estimate,
    Finding,
    Limit,
    Location,
    Misfit,
    Moved,
    Rival,
    Step,
    Trace,
)
from ..wording import experiment_sentence, foremost, named
from .confirm import Confirmed
from .fit import Linear, normal, priors, residuals, simulate, start
from .recording import EVERY, Record, unit_of
from .runs import SHIFTS, Runs
from .search import Found
from .weigh import Weighed, covariances

Array = NDArray[np.float64]

BAND = 1 / (2 * EVERY)
"""[Hz] What means over a window hold."""
MOST_WINDOWS = 6
LEAST = 0.01
"""Share of what changed below which a channel is not listed."""


def report_on(
    runs: Runs, model: Model, found: Found, confirmed: Confirmed, train: Sequence[int], held: Sequence[int],
    seconds: float,
) -> Diagnosis:  # fmt: skip
    """Put everything into words and numbers."""
    records = runs.records
    values = estimates(model, confirmed.train, found.weighed)
    names = {n.placed.key for n in confirmed.names}
    findings = []
    own = [records[i] for i in train]
    locked = [records[i] for i in held]
    before_held = _held_before(found, runs, held)
    for n in confirmed.names:
        p = n.placed
        rivals = tuple(
            Rival(r.effect.name, r.at, share, share < CLASS, experiment_sentence(p, r))
            for r, share in n.rivals
            if share >= 0.005
        )
        missed = confirmed.missed[p.key]
        a, b, unit, channel = _worst(locked, missed.held, confirmed.held)
        what = p.effect.sentence
        evidence = (
            f"{what[:1].upper()}{what[1:]}: the recordings are e^{n.gain:.0f} times likelier with it, and taking it "
            f"out again raises the error of {channel} on the held-out docking from {_size(b, unit)} to "
            f"{_size(a, unit)}."
        )
        findings.append(Finding(p.effect.name, p.at, n.share, n.share, values[p.key], evidence, rivals))
    fits = _fits(own, locked, found.first, confirmed.train, before_held, confirmed.held, found)
    worst = foremost(findings, fits)
    verdict = "missing_physics" if findings else "adequate"
    if findings:
        sentence = (
            f"The model leaves out {named(findings)}. With that added, the error of {worst.channel} on the held-out "
            f"docking falls from {_size(worst.holdout.rms_before, worst.unit)} to "
            f"{_size(worst.holdout.rms_after, worst.unit)}."
        )
    else:
        sentence = "The model is adequate: nothing is left out that has a name and that these dockings can show."
    notes = [f"{Path(r.path).name}: {note}" for r in records for note in r.notes]
    notes += [
        f"{n.placed.effect.name} at {n.placed.at} raised the evidence of the training recordings, and the held-out one "
        "does not miss it: not named"
        for n in confirmed.rejected
    ]
    shifts = ", ".join(f"{k} {x:+.1f}" for k, x in zip(SHIFTS, confirmed.train.at.shifts, strict=True) if abs(x) > 1)
    notes.append(f"numbers of the set-up moved within their tolerances, in deviations: {shifts or 'none by one'}")
    notes.append(f"{runs.count} dockings were simulated in {seconds:.0f} s")
    shown = tuple(
        Candidate(c.placed.effect.name, c.placed.at, c.explained, c.odds, c.placed.key in names)
        for c in found.candidates
    )
    limits = tuple(
        Limit(c.placed.effect.name, c.placed.at, x.name, c.smallest[x.name], x.unit)
        for c in found.candidates
        if c.placed.key not in names
        for x in c.placed.effect.parameters
        if x.name in c.smallest and c.smallest[x.name] <= x.high
    )
    return Diagnosis(
        verdict, sentence, "", model.name, tuple(findings), _locations(own[0], found.first, confirmed.train, found),
        fits, _steps(own, locked, found.first, before_held, confirmed), shown, _moved(model, values, confirmed),
        _traces(own, locked, found.first, confirmed.train, before_held, confirmed.held), limits, tuple(notes), BAND,
        foremost=worst.channel,
    )  # fmt: skip


def estimates(model: Model, at: Linear, weighed: Weighed) -> dict[str, dict[str, Estimate]]:
    """Parameters by the effect's key and their own name, the set-up's numbers free within their tolerances."""
    _, matrix = normal(at, covariances(weighed), priors(model, at.at))
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(matrix / np.outer(size, size), rcond=1e-12)), 0)) / size
    made: dict[str, dict[str, Estimate]] = {}
    k = 0
    for p in at.at.placed:
        made[p.key] = {}
        for x in p.effect.parameters:
            key = f"{p.key}.{x.name}"
            if x.name in p.hold:
                made[p.key][x.name] = Estimate(at.at.fixed[key], 0.0, x.unit)
                continue
            value = float(at.at.values[k])
            bound = bool(min(value - x.low, x.high - value) < 1e-6 * max(abs(g) for g in x.grid))
            made[p.key][x.name] = Estimate(value, float(spread[k]), x.unit, bound)
            k += 1
    return made


def with_found(model: Model, at: Linear) -> Model:
    """The model with what was found: effects and their values."""
    return replace(model, effects=at.at.placed, values={**model.values, **at.at.all_values})


def channel_rms(linear: Linear) -> Array:
    """RMS of measurement less simulation (c,) over all recordings."""
    return np.sqrt(np.mean(np.concatenate(linear.residuals) ** 2, axis=0))


def channel_sizes(records: Sequence[Record]) -> Array:
    """What errors are relative to (c,): RMS since the start."""
    every = np.concatenate([r.measured - r.measured[0] for r in records])
    return np.maximum(np.sqrt(np.nanmean(every**2, axis=0)), 1e-12)


def _held_before(found: Found, runs: Runs, held: Sequence[int]) -> Linear:
    at = found.first.at
    return Linear(at, residuals(runs, held, simulate(runs, held, at)), ())


def _worst(records: Sequence[Record], without: Linear, within: Linear) -> tuple[float, float, str, str]:
    """RMS without and with an effect, unit and name of the channel that misses it most."""
    a, b, size = channel_rms(without), channel_rms(within), channel_sizes(records)
    c = int(np.argmax((a - b) / size))
    channel = records[0].channels[c]
    return float(a[c]), float(b[c]), unit_of(channel), channel


def _size(value: float, unit: str) -> str:
    factor, word = {"m": (1e6, "um"), "rad": (1e3, "mrad")}.get(unit, (1.0, unit))
    return f"{factor * value:.3g} {word}"


def _fits(
    train: Sequence[Record], held: Sequence[Record], first: Linear, last: Linear, held_first: Linear, held_last: Linear,
    found: Found,
) -> tuple[ChannelFit, ...]:  # fmt: skip
    sizes = channel_sizes(train), channel_sizes(held)
    rms = [channel_rms(first), channel_rms(last), channel_rms(held_first), channel_rms(held_last)]
    made = []
    for c, name in enumerate(train[0].channels):
        a, b, d, e = (float(x[c]) for x in rms)
        s, h = float(sizes[0][c]), float(sizes[1][c])
        floor = float(found.noises[c].white)
        made.append(ChannelFit(name, unit_of(name), Misfit(a, b, a / s, b / s), Misfit(d, e, d / h, e / h), floor))
    return tuple(made)


def _relative(records: Sequence[Record], linear: Linear) -> float:
    return float(np.sqrt(np.mean((channel_rms(linear) / channel_sizes(records)) ** 2)))


def _steps(
    train: Sequence[Record], held: Sequence[Record], first: Linear, held_first: Linear, confirmed: Confirmed
) -> tuple[Step, ...]:
    lines = [Step("model as given", _relative(train, first), _relative(held, held_first))]
    if confirmed.names:
        label = "".join(f"+ {n.placed.effect.name} at {n.placed.at} " for n in confirmed.names).strip()
        lines.append(Step(label, _relative(train, confirmed.train), _relative(held, confirmed.held)))
    return tuple(lines)


def _moved(model: Model, values: dict[str, dict[str, Estimate]], confirmed: Confirmed) -> tuple[Moved, ...]:
    given = start(model).all_values
    return tuple(
        Moved(f"{key}.{name}", e.unit, given[f"{key}.{name}"], e.value, e.std)
        for key, own in values.items()
        for name, e in own.items()
        if f"{key}.{name}" in given
    )


def _locations(record: Record, first: Linear, last: Linear, found: Found) -> tuple[Location, ...]:
    """Channels by the share of what the names changed, or of what is left, each in units of its noise."""
    named_any = len(last.at.placed) > len(first.at.placed)
    change = first.residuals[0] - last.residuals[0] if named_any else last.residuals[0]
    noise = np.array([max(n.white, 1e-12) for n in found.noises])
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


def _windows(record: Record, change: Array) -> tuple[tuple[float, float], ...]:
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
    train: Sequence[Record], held: Sequence[Record], first: Linear, last: Linear, held_first: Linear, held_last: Linear
) -> tuple[Trace, ...]:
    made = []
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[Record], Linear, Linear], ...] = (
        ("train", train, first, last),
        ("holdout", held, held_first, held_last),
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
