"""What the link-side encoders say, in words and numbers, and one answer out of that and what the torques say."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.effects import effects
from ...models.model import Model, Placed
from ..diagnosis import ChannelFit, Diagnosis, Finding, Location, Misfit, Step
from ..fitting.experiment import Experiment
from ..search.locate import locate
from .diagnose import LinkDiagnosis
from .findings import (
    candidates_of,
    findings_of,
    length,
    limits_of,
    nameless,
    noise_floor,
    notes_of,
    traces_of,
    unit_of,
)
from .pair import Pair, PairFit


def with_links(
    diagnosis: Diagnosis, model: Model, links: Sequence[LinkDiagnosis], train: Sequence[Experiment]
) -> tuple[Diagnosis, Model]:
    """One answer from the torques' diagnosis and the encoders'.

    Effects are ordered by the share of its own channel's misfit that each kind of channel was told by what is named:
    of torques and of encoders, the kind that is told more goes first.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the torques.
    model : Model
        With what the torques asked for.
    links : sequence of LinkDiagnosis
    train : sequence of Experiment
        Training recordings with link less motor position in place of torque.

    Returns
    -------
    diagnosis, and the model with what was named
    """
    findings = findings_of(links)
    fits = tuple(_fit(link) for link in links)
    first = bool(findings) and (not diagnosis.effects or max(_told(fits)) >= max(_told(diagnosis.fit)))
    own = {(f.name, f.at) for f in findings}
    others = tuple(f for f in diagnosis.effects if (f.name, f.at) not in own)
    # A constant difference of zeros explains nothing that moves, and comes last.
    offsets = tuple(f for f in findings if f.name == "sensor_bias")
    moving = tuple(f for f in findings if f.name != "sensor_bias")
    verdict, description = diagnosis.verdict, diagnosis.description
    sentences, spoken_of = [diagnosis.sentence], diagnosis.foremost
    if findings:
        spoken_of = _foremost(fits).channel if first else spoken_of
        said = _sentence(moving or offsets, fits)
        if verdict == "adequate":
            sentences = ["The torques ask for nothing that these recordings can show."]
        sentences = [said, *sentences] if first else [*sentences, said]
        verdict = "missing_physics"
    elif any(map(nameless, links)) and verdict != "missing_physics":
        description = "; ".join(filter(None, [description, *map(nameless, links)]))
        sentences = [f"Something is missing that no effect of the vocabulary explains: {description}."]
        verdict = "unknown_effect"
    steps, torques = _steps(links), diagnosis
    answer = replace(
        diagnosis,
        verdict=verdict,
        sentence=" ".join(sentences),
        description=description,
        effects=(*moving, *others, *offsets) if first else (*others, *moving, *offsets),
        location=_location(diagnosis, links, fits, train) if findings else diagnosis.location,
        fit=(*fits, *torques.fit) if first else (*torques.fit, *fits),
        steps=(*steps, *torques.steps) if first else (*torques.steps, *steps),
        candidates=(*torques.candidates, *(c for link in links for c in candidates_of(link))),
        traces=(*torques.traces, *(t for link in links for t in traces_of(link))),
        limits=(*torques.limits, *(x for link in links for x in limits_of(link))),
        notes=(*torques.notes, *(n for link in links for n in notes_of(link))),
        foremost=spoken_of,
    )
    return answer, _model(model, links)


def _told(fits: Sequence[ChannelFit]) -> list[float]:
    """Share of each channel's held-out residual energy that what was named explains, 0 to 1."""
    return [max(0.0, 1 - (f.holdout.rms_after / max(f.holdout.rms_before, 1e-300)) ** 2) for f in fits]


def _fit(link: LinkDiagnosis) -> ChannelFit:
    def misfit(pair: Pair, first: PairFit, last: PairFit) -> Misfit:
        reading = np.concatenate([r.motion.to_band(r.motion.q[:, r.joint]) + r.measured for r in pair.runs])
        size = float(np.sqrt(np.mean(reading**2)))
        before, after = (float(np.sqrt(np.mean(f.residual**2))) for f in (first, last))
        return Misfit(before, after, before / size, after / size)

    return ChannelFit(
        f"q_link.{link.pair.joint}",
        unit_of(link.pair),
        misfit(link.pair, link.steps[0], link.steps[-1]),
        misfit(link.locked, link.held[0], link.held[-1]),
        noise_floor(link),
    )


def _foremost(fits: Sequence[ChannelFit]) -> ChannelFit:
    """Of the encoders that differ less with what was named, the one that differed most before."""
    changed = [f for f in fits if f.holdout.rms_after < f.holdout.rms_before]
    return max(changed or fits, key=lambda f: f.holdout.rms_before)


def _sentence(findings: Sequence[Finding], fits: Sequence[ChannelFit]) -> str:
    """What the encoders say, first the kind that is named at most joints."""
    if not findings:
        return ""
    by_name: dict[str, list[str]] = {}
    for f in findings:
        by_name.setdefault(f.name, []).append(f.at)
    words = []
    for name, places in by_name.items():
        value = [next(iter(f.parameters.values())) for f in findings if f.name == name]
        extra = f" of {', '.join(f'{1e3 * v.value:.3g}' for v in value)} ms" if name == "sensor_delay" else ""
        words.append(f"{name.replace('_', ' ')}{extra} at {', '.join(places)}")
    said = f"Link and motor encoders differ by {'; '.join(words)}."
    if all(f.name == "sensor_bias" for f in findings):
        return said
    worst = _foremost(fits)
    before, after = (length(x, worst.unit) for x in (worst.holdout.rms_before, worst.holdout.rms_after))
    return (
        f"{said} With that added, the difference left on {worst.channel}, on the held-out recording, "
        f"falls from {before} to {after}."
    )


def _location(
    diagnosis: Diagnosis, links: Sequence[LinkDiagnosis], fits: Sequence[ChannelFit], train: Sequence[Experiment]
) -> tuple[Location, ...]:
    """Channels by the share of their own misfit that is told; torques and encoders have no unit in common."""
    told = dict(zip((f.channel for f in diagnosis.fit), _told(diagnosis.fit), strict=True))
    places = [(told[p.channel], p) for p in diagnosis.location if told.get(p.channel, 0.0) > 0]
    for link, share in zip(links, _told(fits), strict=True):
        if not link.proofs:
            continue
        number = link.pair.runs[0].joint
        loaded, changes = [], []
        residual = link.steps[0].residual - link.steps[-1].residual
        at = 0
        for e, run in zip(train, link.pair.runs, strict=True):
            tau = np.zeros_like(e.motion.tau)
            tau[:, number] = run.load
            loaded.append(Experiment(replace(e.motion, tau=tau), e.body))
            change = np.zeros((len(run.measured), tau.shape[1]))
            change[:, number] = residual[at : at + len(change)]
            at += len(change)
            changes.append(change)
        found = locate(loaded, changes)
        places += [(share, replace(p, channel=f"q_link.{link.pair.joint}")) for p in found]
    total = sum(share for share, _ in places)
    places.sort(key=lambda x: -x[0])
    return tuple(replace(p, share=float(share / total) * (1 - 1e-12)) for share, p in places)


def _steps(links: Sequence[LinkDiagnosis]) -> list[Step]:
    """Relative misfit of the encoders, each effect's name added at all its joints at once."""

    def line(label: str, upto: dict[str, int]) -> Step:
        values = []
        for pairs, fits in (("pair", "steps"), ("locked", "held")):
            squares = []
            for link in links:
                pair, found = getattr(link, pairs), getattr(link, fits)[upto[link.pair.joint]]
                reading = np.concatenate([r.motion.to_band(r.motion.q[:, r.joint]) + r.measured for r in pair.runs])
                squares.append(found.energy / float(reading @ reading))
            values.append(float(np.sqrt(np.mean(squares))))
        return Step(label, values[0], values[1])

    upto = {link.pair.joint: 0 for link in links}
    lines = [line("link encoders as given", upto)]
    for depth in range(max(len(link.proofs) for link in links) if links else 0):
        by_name: dict[str, list[LinkDiagnosis]] = {}
        for link in links:
            if depth < len(link.proofs):
                by_name.setdefault(link.proofs[depth].named.trial.placed.effect.name, []).append(link)
        for name, members in by_name.items():
            upto |= {link.pair.joint: depth + 1 for link in members}
            places = ", ".join(link.proofs[depth].named.trial.placed.at for link in members)
            lines.append(line(f"+ {name} at {places}", upto))
    return lines


def _model(model: Model, links: Sequence[LinkDiagnosis]) -> Model:
    """The model with what the encoders asked for."""
    placed, values = {p.key: p for p in model.effects}, dict(model.values)
    for link in links:
        found = link.steps[-1]
        for p in found.placed:
            placed[p.key] = p
            for parameter, value in zip(p.effect.parameters, found.theta[found.parameters(p)], strict=True):
                values[f"{p.key}.{parameter.name}"] = float(value)
        if link.offset is not None:
            bias = Placed(effects()["sensor_bias"], f"q_link.{link.pair.joint}")
            placed[bias.key] = bias
            values[f"{bias.key}.offset"] = link.offset.value
    return replace(model, effects=tuple(placed.values()), values=values)
