"""Put what was decided into words and numbers: the `Diagnosis` that JSON, report and tests share."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..models.floating.tree import channel
from ..models.model import Model
from ..report.words import percent
from .arms.kind import ArmFit
from .decision.confirm import Loss
from .decision.decide import Decision
from .decision.selection import Naming
from .diagnosis import (
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
from .fitting.experiment import Experiment
from .fitting.fit import Fit, channel_rms
from .fitting.floating_terms import momentum_floor
from .reliability import of_name
from .search.locate import locate
from .wording import evidence_sentence, experiment_sentence, foremost, listed, noise_words, rejection, verdict_sentence

Array = NDArray[np.float64]


def report_on(
    model: Model,
    decided: Decision[ArmFit],
    final: Fit,
    steps: tuple[Step, ...],
    train: Sequence[Experiment],
    held: Sequence[Experiment],
) -> Diagnosis:
    """Put everything into words and numbers.

    Parameters
    ----------
    model : Model
        Baseline.
    decided : Decision
        Verdict, names, nameless curves, and what was not confirmed.
    final : Fit
        With the confirmed effects.
    steps : tuple of Step
    train, held : sequence of Experiment
    """
    found, best = decided.best.found, decided.best
    channels = [channel(model.tree, c) for c in range(model.tree.n_joints)]
    findings = tuple(_finding(n, decided, final, held, channels) for n in best.names)
    fits = channel_fits(model, found.first.fit, final, train, held)
    left = decided.left
    again = {c: b for c, b in left.bursts.items() if b.again}
    loud = sorted({r.channel for r in left.curves} | set(again) | set(left.vibrations))

    def size(c: int, share: float) -> str:
        return percent(float(np.sqrt(share)) * fits[c].train.relative_after)

    said = [
        f"on {channels[r.channel]}, a smooth curve over {r.over} still explains {percent(r.explained)} of the residual "
        f"({size(r.channel, r.explained)} of the channel's torque)"
        for r in left.curves
    ] + [
        f"on {channels[c]}, {percent(b.share)} of the residual comes in bursts, at {b.frequency:.2g} Hz where it is "
        f"strongest ({size(c, b.share)} of the channel's torque)"
        for c, b in again.items()
    ]
    said += [
        f"on {channels[c]}, a vibration of {v.frequency:.2g} Hz at {percent(v.slow)} to {percent(v.fast)} of the peak "
        f"speed still explains {percent(v.explained)} of the residual ({size(c, v.explained)} of the channel's torque)"
        for c, v in left.vibrations.items()
    ]
    description = "; ".join(said)
    if findings:
        remainder = (
            f" Part of the remaining residual of {listed([channels[c] for c in loud])} has no name." if loud else ""
        )
    else:
        remainder = f" {description[:1].upper()}{description[1:]}." if description else ""
    noise = {
        channels[c]: noise_words(fits[c].unit, x, [row[c].encoder for row in found.weighed.runs])
        for c, x in enumerate(left.noises or found.weighed.noises)
    }
    named = {n.placed.key for n in best.names}
    notes = [f"{Path(e.motion.path).name}: {note}" for e in (*train, *held) for note in e.motion.notes]
    notes += [rejection(n.placed) for n in decided.rejected if n.placed.key not in named]
    notes += [
        f"on {channels[c]}, {percent(b.share)} of the residual comes in bursts that do not recur: a knock, or outliers"
        for c, b in left.bursts.items()
        if not b.again
    ]
    notes += [f"noise of {c}: {words}" for c, words in noise.items()] + _excitation(train)
    candidates = tuple(
        Candidate(t.placed.effect.name, t.placed.at, t.explained, t.odds, t.placed.key in named)
        for t in found.trials
        if t.explained > 0
    )
    explained = [_explained(found.first.fit, final, e) for e in train]
    if not findings:
        # What has no name stands in the residual itself, on the channels that have something to say.
        spoken = [c in loud for c in range(len(channels))]
        explained = [(e.measured - e.motion.to_band(final.assembly.torque(e, final.theta))) * spoken for e in train]
    spoken_of = [f for c, f in enumerate(fits) if findings or not loud or c in loud]
    return Diagnosis(
        decided.verdict,
        verdict_sentence(findings, spoken_of, remainder, noise),
        description,
        model.name,
        findings,
        locate(train, explained),
        fits,
        steps,
        candidates,
        moved(found.first.fit, final),
        traces(found.first.fit, final, train, held),
        _limits(decided, final),
        tuple(notes),
        train[0].motion.band,
        foremost=foremost(findings, spoken_of, remainder).channel,
    )


def _explained(first: Fit, final: Fit, experiment: Experiment) -> Array:
    """Torque that the added physics makes of a recording's motion, in the analysis band (n_band, J)."""
    change = final.assembly.torque(experiment, final.theta) - first.assembly.torque(experiment, first.theta)
    return experiment.motion.to_band(change)


def _finding(
    n: Naming, decided: Decision[ArmFit], final: Fit, held: Sequence[Experiment], every: Sequence[str]
) -> Finding:
    placed = n.placed
    parameters = {
        final.assembly.slots[i].name: Estimate(
            float(final.theta[i]), float(final.std[i]), final.assembly.slots[i].unit, bool(final.at_bound[i])
        )
        for i in final.assembly.index_of(placed)
    }
    missed = decided.best.missed[placed.key]
    # The posterior is shared among those that cannot be told apart; how often such a name is right was counted.
    whole = n.share + sum(r.probability for r in n.rivals if not r.separable)
    share = _share_of_energy(decided, missed, held)
    right = of_name(n.gain, missed.sure, share)
    scale = right / max(whole, 1e-12)
    rivals = tuple(
        Rival(
            r.placed.effect.name,
            r.placed.at,
            r.probability * (min(right, 1.0) if r.separable else scale),
            r.separable,
            experiment_sentence(placed, r.placed),
        )
        for r in n.rivals
    )
    sentence = evidence_sentence(placed, [every[c] for c in n.channels], *_trial(decided.best.last.fit, missed, held))
    return Finding(
        placed.effect.name,
        placed.at,
        missed.sure,
        n.share * scale,
        parameters,
        sentence,
        rivals,
        n.gain,
        share,
    )


def _trial(final: Fit, missed: Loss[ArmFit], held: Sequence[Experiment]) -> tuple[float, float]:
    """Relative errors of the held-out recordings with an effect and without it, where the two differ most."""
    both = [channel_rms(f.assembly, held, f.theta) for f in (final, missed.fit.fit)]
    with_it, without = (float(rms[missed.channel] / both[0][1][missed.channel]) for rms, _ in both)
    return with_it, without


def _share_of_energy(decided: Decision[ArmFit], missed: Loss[ArmFit], held: Sequence[Experiment]) -> float:
    """Share of a channel's residual energy that goes with an effect, every sample by its own variance: near rest, where
    a joint holds any torque, little counts. A wander counts as residual: a law without a name may look like it."""
    weighed, sums, c = decided.found.weighed, np.zeros(2), missed.channel
    for e, row in zip(held, weighed.evidence.channels[weighed.n_train :], strict=True):
        both = [f.assembly.residual(e, f.theta)[0][:, c] for f in (decided.best.last.fit, missed.fit.fit)]
        sums += [float(np.sum(x**2 / row[c].covariance.variance)) for x in both]
    return float(np.clip(1 - sums[0] / sums[1], 0.0, 1.0)) if sums[1] > 0 else 0.0


def _limits(decided: Decision[ArmFit], final: Fit) -> tuple[Limit, ...]:
    """What would have been named beside all that was, had it been there."""
    return tuple(
        Limit(t.placed.effect.name, t.placed.at, p.name, t.smallest[p.name], final.assembly.unit(t.placed, p))
        for t in decided.best.found.closing
        for p in t.placed.effect.parameters
        if p.name in t.smallest
    )


def channel_fits(
    model: Model, first: Fit, final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[ChannelFit, ...]:
    """Misfit of every channel before and after, and its noise floor."""
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
        carriers = e.body.tree.carriers
        if carriers:
            floors[-1][:carriers] = momentum_floor(e)
    return np.min(floors, axis=0)


def moved(first: Fit, final: Fit) -> tuple[ParameterShift, ...]:
    """Parameters of the baseline before and after."""
    after = {s.key: (v, d) for s, v, d in zip(final.assembly.slots, final.theta, final.std, strict=True)}
    return tuple(
        ParameterShift(s.key, s.unit, float(v), float(after[s.key][0]), float(after[s.key][1]))
        for s, v in zip(first.assembly.slots, first.theta, strict=True)
        if s.key in after
    )


def traces(first: Fit, final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]) -> tuple[Trace, ...]:
    """Every channel of every recording, measured and modelled before and after."""
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
