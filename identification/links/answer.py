"""The diagnosis of link encoders in words and numbers, and one answer with the diagnosis of the torques."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.model import Model
from ..diagnosis import ChannelFit, Diagnosis, Finding, Location, Step
from ..fitting.experiment import Experiment
from ..search.locate import locate
from ..sources.answer import candidates, channel_fits, limits, rms, with_found
from ..verdict import gravest
from .diagnose import EncoderComparison
from .findings import findings_of, length, nameless, noise_floor, notes_of, traces_of, unit_of
from .source import Links


def with_links(diagnosis: Diagnosis, model: Model, one: EncoderComparison) -> tuple[Diagnosis, Model]:
    """One answer from the torques' diagnosis and the encoders'.

    Effects are ordered by the share of its own channel's misfit that each kind of channel was told by what is named:
    of torques and of encoders, the kind that is told more goes first.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the torques.
    model : Model
        With what the torques asked for.
    one : EncoderComparison

    Returns
    -------
    diagnosis, and the model with what was named
    """
    links, decided = one.links, one.decided
    findings, fits = findings_of(one), _fits(one)
    still = {(n.placed.effect.name, n.placed.at) for n in decided.best.names if links.still(n.placed)}
    first = bool(findings) and (not diagnosis.effects or max(_told(fits)) >= max(_told(diagnosis.fit)))
    own = {(f.name, f.at) for f in findings}
    others = tuple(f for f in diagnosis.effects if (f.name, f.at) not in own)
    # A constant difference of zeros explains nothing that moves, and comes last.
    offsets = tuple(f for f in findings if (f.name, f.at) in still)
    moving = tuple(f for f in findings if (f.name, f.at) not in still)
    both, description = gravest(diagnosis.verdict, decided.verdict), diagnosis.description
    sentences, spoken_of = [diagnosis.sentence], diagnosis.foremost
    if findings:
        spoken_of = _foremost(fits).channel if first else spoken_of
        said = _sentence(moving, offsets, fits)
        if diagnosis.verdict == "adequate":
            sentences = ["The torques show nothing that the model leaves out."]
        sentences = [said, *sentences] if first else [*sentences, said]
    elif decided.left.curves and both == "unknown_effect":
        description = "; ".join(filter(None, [description, nameless(one)]))
        sentences = [f"Something is missing that no effect of the vocabulary explains: {description}."]
    steps, torques = _steps(one), diagnosis
    answer = replace(
        diagnosis,
        verdict=both,
        sentence=" ".join(sentences),
        description=description,
        effects=(*moving, *others, *offsets) if first else (*others, *moving, *offsets),
        location=_location(diagnosis, one, fits) if findings else diagnosis.location,
        fit=(*fits, *torques.fit) if first else (*torques.fit, *fits),
        steps=(*steps, *torques.steps) if first else (*torques.steps, *steps),
        candidates=(*torques.candidates, *candidates(decided)),
        traces=(*torques.traces, *traces_of(one)),
        limits=(*torques.limits, *limits(links, decided)),
        notes=(*torques.notes, *notes_of(one)),
        foremost=spoken_of,
    )
    return answer, with_found(model, decided.train.at)


def _told(fits: Sequence[ChannelFit]) -> list[float]:
    """Share of each channel's held-out residual energy that what was named explains, 0 to 1."""
    return [max(0.0, 1 - (f.holdout.rms_after / max(f.holdout.rms_before, 1e-300)) ** 2) for f in fits]


def _fits(one: EncoderComparison) -> tuple[ChannelFit, ...]:
    links, every = one.links, range(len(one.links.joints))
    sizes = _readings(links, links.train), _readings(links, links.held)
    units, floors = [unit_of(links, c) for c in every], [noise_floor(links, c) for c in every]
    return channel_fits(one.decided, links.channels, units, *sizes, floors)


def _readings(links: Links, numbers: Sequence[int]) -> np.ndarray:
    """RMS of each link encoder's own reading (c,)."""
    rows = [[r.motion.to_band(r.motion.q[:, r.joint]) + r.measured for r in links.rows[i]] for i in numbers]
    return np.sqrt(np.mean(np.concatenate([np.stack(row, axis=1) for row in rows]) ** 2, axis=0))


def _foremost(fits: Sequence[ChannelFit]) -> ChannelFit:
    """Of the encoders that differ less with what was named, the one that differed most before."""
    changed = [f for f in fits if f.holdout.rms_after < f.holdout.rms_before]
    return max(changed or fits, key=lambda f: f.holdout.rms_before)


def _sentence(moving: Sequence[Finding], offsets: Sequence[Finding], fits: Sequence[ChannelFit]) -> str:
    """What the encoders say; of zeros only where nothing moves."""
    findings = moving or offsets
    by_name: dict[str, list[str]] = {}
    for f in findings:
        by_name.setdefault(f.name, []).append(f.at)
    words = []
    for name, places in by_name.items():
        value = [next(iter(f.parameters.values())) for f in findings if f.name == name]
        extra = f" of {', '.join(f'{1e3 * v.value:.3g}' for v in value)} ms" if value[0].unit == "s" else ""
        words.append(f"{name.replace('_', ' ')}{extra} at {', '.join(places)}")
    said = f"Link and motor encoders differ by {'; '.join(words)}."
    if not moving:
        return said
    worst = _foremost(fits)
    before, after = (length(x, worst.unit) for x in (worst.holdout.rms_before, worst.holdout.rms_after))
    return (
        f"{said} With that added, the remaining difference of {worst.channel} on the held-out recording "
        f"falls from {before} to {after}."
    )


def _location(diagnosis: Diagnosis, one: EncoderComparison, fits: Sequence[ChannelFit]) -> tuple[Location, ...]:
    """Channels by the share of their own misfit that is told; torques and encoders have no unit in common."""
    told = dict(zip((f.channel for f in diagnosis.fit), _told(diagnosis.fit), strict=True))
    places = [(told[p.channel], p) for p in diagnosis.location if told.get(p.channel, 0.0) > 0]
    links, decided = one.links, one.decided
    named = {c for n in decided.best.names for c in n.channels}
    for c, share in enumerate(_told(fits)):
        if c not in named:
            continue
        loaded, changes = [], []
        pairs = zip(decided.found.first.train.residuals, decided.train.residuals, strict=True)
        for e, row, (before, after) in zip(one.train, links.rows, pairs, strict=False):
            tau, change = np.zeros_like(e.motion.tau), np.zeros((len(before), e.motion.tau.shape[1]))
            tau[:, row[c].joint], change[:, row[c].joint] = row[c].load, (before - after)[:, c]
            loaded.append(Experiment(replace(e.motion, tau=tau), e.body))
            changes.append(change)
        places += [(share, replace(p, channel=links.channels[c])) for p in locate(loaded, changes)]
    total = sum(share for share, _ in places)
    places.sort(key=lambda x: -x[0])
    return tuple(replace(p, share=float(share / total) * (1 - 1e-12)) for share, p in places)


def _steps(one: EncoderComparison) -> list[Step]:
    """Relative misfit of the encoders, each effect's name added at all its joints at once."""
    sizes = [_readings(one.links, numbers) for numbers in (one.links.train, one.links.held)]
    return [
        Step(label, *(float(np.sqrt(np.mean((rms(x) / s) ** 2))) for x, s in zip(fits, sizes, strict=True)))
        for label, *fits in one.stages
    ]
