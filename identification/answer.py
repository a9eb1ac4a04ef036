"""Put a search's findings into words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..models.floating.tree import channel, n_carriers
from ..models.model import Model
from .diagnosis import Candidate, ChannelFit, Diagnosis, Estimate, Finding, Misfit, Moved, Rival, Step, Trace
from .fitting.experiment import Experiment
from .fitting.fit import Fit, channel_rms
from .fitting.floating_terms import momentum_floor
from .reliability import probability as reliability
from .search.bursts import bursts
from .search.candidates import has_whole_law
from .search.choice import Taken
from .search.forward import Found
from .search.locate import locate
from .search.trial import MATERIAL
from .search.whole_law import beside_whole_laws
from .wording import evidence_sentence, experiment_sentence, listed, percent, verdict_sentence

Array = NDArray[np.float64]

NAMELESS = 0.1
"""Smooth curves that explain this share of a channel's residual, in blocks they did not see, mean a nameless effect
..."""

PLAIN = 0.5
"""... if they also amount to `MATERIAL` of the channel's RMS torque, or if they are this much of the residual: on a
joint that carries a lot, plain and yet a small share of it. With a whole friction law there, that may be its form."""


def report_on(
    model: Model,
    found: Found,
    confirmed: Sequence[Taken],
    doubtful: Sequence[Taken],
    final: Fit,
    trials: Mapping[str, tuple[float, float]],
    steps: tuple[Step, ...],
    train: Sequence[Experiment],
    locked: Sequence[Experiment],
) -> Diagnosis:
    """Put everything into words and numbers.

    Parameters
    ----------
    model : Model
        Baseline.
    found : Found
        The search's result.
    confirmed : sequence of Taken
        What the held-out recording confirmed; the rest of ``found.taken`` goes into the notes.
    doubtful : sequence of Taken
        What it confirmed too, and what only stands in for something that has no name.
    final : Fit
        With the confirmed effects.
    trials : mapping of str to (with, without)
        Relative held-out error of each effect's worst channel, with the effect and with it taken out.
    steps : tuple of Step
    train, locked : sequence of Experiment
    """
    channels = [channel(model.tree, c) for c in range(model.tree.n_joints)]
    findings = tuple(
        _finding(beside_whole_laws(t, final, found.closing, train), final, trials, channels) for t in confirmed
    )
    fits = _fits(model, found.first, final, train, locked)
    nameless = {c: x for c, x in found.closing.nameless.items() if x.share > NAMELESS}
    # What a curve explains well may also come and go.
    bursting = bursts(final, train)
    unsteady = {c: b for c, b in bursting.items() if b.again and (c not in nameless or nameless[c].share < PLAIN)}

    def size(c: int, share: float) -> float:
        return float(np.sqrt(share)) * fits[c].train.relative_after

    said = [
        (
            c,
            x.share,
            f"on {channels[c]}, smooth curves over {x.over} still explain {percent(x.share)} of the residual in "
            f"blocks that they were not fitted to ({percent(size(c, x.share))} of the channel's torque)",
        )
        for c, x in nameless.items()
    ] + [
        (
            c,
            b.share,
            f"on {channels[c]}, {percent(b.share)} of the residual comes in bursts, at {b.frequency:.2g} Hz where "
            f"it is strongest ({percent(size(c, b.share))} of the channel's torque)",
        )
        for c, b in unsteady.items()
    ]
    plain = {c for c, x in nameless.items() if x.share > PLAIN}
    formed = {c for c in plain if has_whole_law(final.assembly.placed, model.joints[c])}
    loud = {c for c, x, _ in said if size(c, x) >= MATERIAL} | (plain - formed)
    description = "; ".join(text for c, _, text in said if c in loud)
    if findings:
        verdict = "missing_physics"
        remainder = (
            f" Part of what is left on {listed([channels[c] for c in sorted(loud)])} has no name." if loud else ""
        )
    else:
        verdict = "unknown_effect" if description else "adequate"
        remainder = f" {description[:1].upper()}{description[1:]}." if description else ""
    named = {t.judged.placed.key for t in confirmed}
    notes = [f"{Path(e.motion.path).name}: {note}" for e in (*train, *locked) for note in e.motion.notes]
    notes += [
        f"{t.judged.placed.effect.name} at {t.judged.placed.at} passed on the training recordings but made the "
        f"held-out one hardly better: not named"
        for t in found.taken
        if t.judged.placed.key not in named
    ]
    notes += [
        f"{t.judged.placed.effect.name} at {t.judged.placed.at} explains some of it, but smooth curves far more: "
        f"not named"
        for t in doubtful
    ]
    notes += [f"too little to speak of: {text}" for c, _, text in said if c not in loud]
    notes += [
        f"on {channels[c]}, {percent(b.share)} of the residual stands in one window and has not come again: "
        "a knock, or an outlier"
        for c, b in bursting.items()
        if not b.again
    ]
    notes += _excitation(train)
    candidates = tuple(
        Candidate(j.placed.effect.name, j.placed.at, float(j.explained), float(j.score), j.placed.key in named)
        for j in sorted(found.opening.judged, key=lambda j: -j.explained)
        if j.explained > 0
    )
    explained = [_explained(found.first, final, e) for e in train]
    if not findings:
        # What has no name stands in the residual itself, on the channels that have something to say.
        spoken = [c in loud for c in range(len(channels))]
        explained = [(e.measured - e.motion.to_band(final.assembly.torque(e, final.theta))) * spoken for e in train]
    return Diagnosis(
        verdict,
        verdict_sentence(findings, [f for c, f in enumerate(fits) if findings or not loud or c in loud], remainder),
        description,
        model.name,
        findings,
        locate(train, explained),
        fits,
        steps,
        candidates,
        _moved(found.first, final),
        _traces(found.first, final, train, locked),
        found.closing.limits,
        tuple(notes),
        train[0].motion.band,
    )


def _explained(first: Fit, final: Fit, experiment: Experiment) -> Array:
    """Torque that the added physics makes of a recording's motion, in the analysis band (n_band, J)."""
    change = final.assembly.torque(experiment, final.theta) - first.assembly.torque(experiment, first.theta)
    return experiment.motion.to_band(change)


def _finding(t: Taken, final: Fit, trials: Mapping[str, tuple[float, float]], every: Sequence[str]) -> Finding:
    placed = t.judged.placed
    parameters = {
        final.assembly.slots[i].name: Estimate(
            float(final.theta[i]), float(final.std[i]), final.assembly.slots[i].unit, bool(final.at_bound[i])
        )
        for i in final.assembly.index_of(placed)
    }
    with_it, without_it = trials[placed.key]
    channels = [every[c] for c in t.judged.channels]
    # How often a name with this margin was right, counting those that cannot be told from it: they share it as the
    # bootstrap was shared.
    whole = t.probability + sum(r.probability for r in t.rivals if not r.separable)
    right = reliability(whole)
    rivals = tuple(
        Rival(
            r.placed.effect.name,
            r.placed.at,
            r.probability * (right if r.separable else right / whole),
            r.separable,
            experiment_sentence(placed, r.placed),
        )
        for r in t.rivals
        if r.probability >= 0.005 or not r.separable
    )
    sentence = evidence_sentence(placed, t.judged.explained, channels, with_it, without_it)
    return Finding(placed.effect.name, placed.at, whole, t.probability * right / whole, parameters, sentence, rivals)


def _fits(
    model: Model, first: Fit, final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[ChannelFit, ...]:
    pairs = []
    for experiments in (train, locked):
        before, measured = channel_rms(first.assembly, experiments, first.theta)
        after, _ = channel_rms(final.assembly, experiments, final.theta)
        pairs.append(
            [
                Misfit(float(b), float(a), float(b / m), float(a / m))
                for b, a, m in zip(before, after, measured, strict=True)
            ]
        )
    floors = _noise_floor(train, final)
    return tuple(
        ChannelFit(
            channel(model.tree, c),
            "N" if j.kind == "prismatic" else "N*m",
            fitted,
            held_out,
            float(floor),
        )
        for c, (j, fitted, held_out, floor) in enumerate(zip(model.tree.joints, *pairs, floors, strict=True))
    )


def _noise_floor(experiments: Sequence[Experiment], final: Fit) -> Array:
    """RMS in the analysis band of white noise as strong as the raw residual above twice that band (J,)."""
    floors = []
    for e in experiments:
        raw = e.motion.tau - final.assembly.torque(e, final.theta)
        longest = max(e.motion.segments, key=lambda s: s.stop - s.start)
        part = raw[longest] * np.hanning(longest.stop - longest.start)[:, None]
        frequency = np.fft.rfftfreq(len(part), e.motion.period)
        density = np.abs(np.fft.rfft(part, axis=0)) ** 2 / (0.375 * len(part)) * 2 * e.motion.period
        top = frequency > min(2 * e.motion.band, 0.4 / e.motion.period)
        # The median of a periodogram is ln 2 of its mean, and is not moved by single lines.
        floors.append(np.sqrt(np.median(density[top], axis=0) / np.log(2) * e.motion.band))
        carriers = n_carriers(e.body.tree)
        if carriers:
            floors[-1][:carriers] = momentum_floor(e)
    return np.min(floors, axis=0)


def _moved(first: Fit, final: Fit) -> tuple[Moved, ...]:
    after = {s.key: (v, d) for s, v, d in zip(final.assembly.slots, final.theta, final.std, strict=True)}
    return tuple(
        Moved(s.key, s.unit, float(v), float(after[s.key][0]), float(after[s.key][1]))
        for s, v in zip(first.assembly.slots, first.theta, strict=True)
        if s.key in after
    )


def _traces(first: Fit, final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]) -> tuple[Trace, ...]:
    found = []
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[Experiment]], ...] = (("train", train), ("holdout", locked))
    for role, experiments in sets:
        for e in experiments:
            bring = e.motion.to_band
            before, after = (bring(f.assembly.torque(e, f.theta)) for f in (first, final))
            time, q, qd = bring(e.motion.time), bring(e.motion.q), bring(e.motion.qd)
            for c, joint in enumerate(e.body.tree.joints):
                unit = "N" if joint.kind == "prismatic" else "N*m"
                columns = (x[:, c] for x in (q, qd, e.measured, before, after))
                found.append(Trace(Path(e.motion.path).name, role, channel(e.body.tree, c), unit, time, *columns))
    return tuple(found)


def _excitation(train: Sequence[Experiment]) -> list[str]:
    """What the motion can show: reversals, and the share of time each joint moves."""
    notes = []
    for c, joint in enumerate(train[0].motion.joints):
        qd = np.concatenate([e.motion.qd[:, c] for e in train])
        moving = np.abs(qd) > 0.05 * np.abs(qd).max()
        signs = np.sign(qd[moving])
        reversals = int(np.count_nonzero(np.diff(signs)))
        notes.append(
            f"excitation of {joint}: moving {percent(float(np.mean(moving)))} of the time, {reversals} reversals"
        )
    return notes
