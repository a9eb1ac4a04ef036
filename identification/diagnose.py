"""From recordings to a verdict: steps 0 to 6 of a diagnosis, for joint-space recordings.

0 condition · 1 fit the baseline · 2 detect · 3 locate · 4 hypothesise · 5 compare and decide (`search`) · 6 confirm
once, on a recording that nothing before has looked at: an effect stays only if taking it out again makes it worse.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..models.effects import effects
from ..models.hidden_state import prepare
from ..models.model_file import Model
from ..models.rigid_body import RigidBody
from .assembly import Assembly
from .base_parameters import base_parameters
from .diagnosis import Candidate, ChannelFit, Diagnosis, Estimate, Finding, Misfit, Moved, Rival, Step, Trace
from .experiment import Experiment, load_experiments, scales
from .fit import Fit, channel_rms, fit
from .identify import inertial_values, physical
from .locate import locate
from .search import Found, Taken, carry, search, without
from .wording import evidence_sentence, experiment_sentence, percent, verdict_sentence

Array = NDArray[np.float64]

CONFIRM = 0.05
"""An effect is confirmed if the held-out residual energy of its channels rises by this share when it is taken out."""

NAMELESS = 0.1
"""Smooth curves that explain this share of a channel's residual, in blocks they did not see, mean a nameless effect
..."""

MATERIAL = 0.01
"""... if they also amount to this share of the channel's RMS torque."""


@dataclass(frozen=True)
class Answer:
    """A diagnosis, and the model with what it found."""

    diagnosis: Diagnosis
    model: Model


def diagnose(
    model: Model,
    recordings: Sequence[str | Path],
    holdout: str | Path,
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Answer:
    """Find, name, add and confirm the physics that a model leaves out.

    Parameters
    ----------
    model : Model
    recordings : sequence of path
        Fitted and searched.
    holdout : path
        Opened for the proof only.
    progress : callable
        Told in a few words what is under way.
    seed : int
        Of bootstraps and nulls.

    Raises
    ------
    InputError
        Whatever is wrong with the recordings, or a holdout that is one of them.
    """
    if Path(holdout).resolve() in [Path(r).resolve() for r in recordings]:
        raise InputError(f"{holdout}: the holdout is also a recording to fit; hold out one that the fit does not see")
    progress("reading and conditioning the recordings")
    prepare(effects().values())
    body = RigidBody(model.tree)
    train = load_experiments(model, recordings, body)
    band = min(e.motion.band for e in train)
    locked = load_experiments(model, [holdout], body, band)
    base = base_parameters(body) if model.inertia == "free" else None
    found = search(model, base, scales(train), train, progress=progress, seed=seed)
    progress("confirming on the held-out recording")
    confirmed, trials = _confirm(found, train, locked)
    if len(confirmed) < len(found.taken):
        kept = {t.judged.placed.key for t in confirmed}
        dropped = [t for t in found.taken if t.judged.placed.key not in kept]
        assembly = found.fit.assembly
        for t in dropped:
            assembly = without(replace(found.fit, assembly=assembly), t.judged.placed)
        final = fit(assembly, train, start=carry(found.fit, assembly), multi_start=False)
    else:
        final, dropped = found.fit, []
    final, inertia = physical(final, train)
    steps = _steps(found, confirmed, final, train, locked)
    answer = _answer(model, found, confirmed, dropped, final, trials, steps, train, locked)
    return replace(
        answer, model=replace(answer.model, values={**answer.model.values, **inertial_values(model, inertia)})
    )


def _confirm(
    found: Found, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[list[Taken], Mapping[str, tuple[float, float]]]:
    """Effects whose removal (all else fitted again) makes the held-out recording worse; errors with and without
    each."""
    with_all, measured = channel_rms(found.fit.assembly, locked, found.fit.theta)
    confirmed, trials = [], {}
    for t in found.taken:
        placed = t.judged.placed
        assembly = without(found.fit, placed)
        again = fit(assembly, train, start=carry(found.fit, assembly), multi_start=False)
        rms, _ = channel_rms(assembly, locked, again.theta)
        c = list(t.judged.channels)
        energy = [float(np.sum((x[c] / measured[c]) ** 2)) for x in (with_all, rms)]
        if energy[1] > (1 + CONFIRM) * energy[0]:
            confirmed.append(t)
        worst = c[int(np.argmax(rms[c] / measured[c] - with_all[c] / measured[c]))]
        trials[placed.key] = (float(with_all[worst] / measured[worst]), float(rms[worst] / measured[worst]))
    return confirmed, trials


def _steps(
    found: Found, confirmed: Sequence[Taken], final: Fit, train: Sequence[Experiment], locked: Sequence[Experiment]
) -> tuple[Step, ...]:
    """Relative misfit after each effect is added, all parameters fitted again on the training recordings."""

    def line(label: str, assembly: Assembly, theta: Array) -> Step:
        pair = [channel_rms(assembly, e, theta) for e in (train, locked)]
        relative = [float(np.sqrt(np.mean((rms / measured) ** 2))) for rms, measured in pair]
        return Step(label, relative[0], relative[1])

    steps = [line("model as given", found.first.assembly, found.first.theta)]
    names = list(dict.fromkeys(t.judged.placed.effect.name for t in confirmed))
    old = final.assembly
    values = old.values(final.theta)
    for k, name in enumerate(names):
        rest = {t.judged.placed.key for t in confirmed if t.judged.placed.effect.name in names[k + 1 :]}
        if rest:
            assembly = Assembly(old.tree, [p for p in old.placed if p.key not in rest], old.base, old.scales, values)
            theta = fit(assembly, train, start=carry(final, assembly), multi_start=False).theta
        else:
            assembly, theta = old, final.theta
        at = [t.judged.placed.at for t in confirmed if t.judged.placed.effect.name == name]
        steps.append(line(f"+ {name} at {', '.join(at)}", assembly, theta))
    return tuple(steps)


def _answer(
    model: Model,
    found: Found,
    confirmed: Sequence[Taken],
    dropped: Sequence[Taken],
    final: Fit,
    trials: Mapping[str, tuple[float, float]],
    steps: tuple[Step, ...],
    train: Sequence[Experiment],
    locked: Sequence[Experiment],
) -> Answer:
    """Put everything into words and numbers."""
    joints = model.joints
    findings = tuple(_finding(t, final, trials, joints) for t in confirmed)
    fits = _fits(model, found.first, final, train, locked)
    nameless = {c: x for c, x in found.closing.nameless.items() if x > NAMELESS}
    size = {c: float(np.sqrt(x)) * fits[c].train.relative_after for c, x in nameless.items()}
    words = {
        c: (
            f"on tau.{joints[c]}, smooth curves over position, speed, load and time together still explain "
            f"{percent(x)} of the residual in blocks that they were not fitted to "
            f"({percent(size[c])} of the channel's torque)"
        )
        for c, x in nameless.items()
    }
    description = "; ".join(text for c, text in words.items() if size[c] >= MATERIAL)
    if findings:
        verdict = "missing_physics"
        remainder = f" Still unnamed: {description}." if description else ""
    else:
        verdict = "unknown_effect" if description else "adequate"
        remainder = f" {description[:1].upper()}{description[1:]}." if description else ""
    notes = [f"{Path(e.motion.path).name}: {note}" for e in (*train, *locked) for note in e.motion.notes]
    notes += [
        f"{t.judged.placed.effect.name} at {t.judged.placed.at} passed on the training recordings but made the "
        f"held-out one no better: not named"
        for t in dropped
    ]
    notes += [f"too little to speak of: {text}" for c, text in words.items() if size[c] < MATERIAL]
    notes += _excitation(train)
    named = {t.judged.placed.key for t in confirmed}
    candidates = tuple(
        Candidate(j.placed.effect.name, j.placed.at, float(j.explained), float(j.score), j.placed.key in named)
        for j in sorted(found.opening.judged, key=lambda j: -j.explained)
        if j.explained > 0
    )
    location = locate(found.first, final, train) if findings else ()
    diagnosis = Diagnosis(
        verdict,
        verdict_sentence(findings, fits, remainder),
        description,
        model.name,
        findings,
        location,
        fits,
        steps,
        candidates,
        _moved(found.first, final),
        _traces(found.first, final, train, locked),
        found.closing.limits,
        tuple(notes),
        train[0].motion.band,
    )
    placed = final.assembly.placed
    values = {**model.values, **final.assembly.values(final.theta)}
    return Answer(diagnosis, replace(model, effects=placed, values=values))


def _finding(t: Taken, final: Fit, trials: Mapping[str, tuple[float, float]], joints: Sequence[str]) -> Finding:
    placed = t.judged.placed
    parameters = {
        final.assembly.slots[i].name: Estimate(
            float(final.theta[i]), float(final.std[i]), final.assembly.slots[i].unit, bool(final.at_bound[i])
        )
        for i in final.assembly.index_of(placed)
    }
    with_it, without_it = trials[placed.key]
    channels = [f"tau.{joints[c]}" for c in t.judged.channels]
    rivals = tuple(
        Rival(r.placed.effect.name, r.placed.at, r.probability, r.separable, experiment_sentence(placed, r.placed))
        for r in t.rivals
        if r.probability >= 0.005 or not r.separable
    )
    sentence = evidence_sentence(placed, t.judged.explained, channels, with_it, without_it)
    return Finding(placed.effect.name, placed.at, t.probability, parameters, sentence, rivals)


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
        ChannelFit(f"tau.{j.name}", "N" if j.kind == "prismatic" else "N*m", fitted, held_out, float(floor))
        for j, fitted, held_out, floor in zip(model.tree.joints, *pairs, floors, strict=True)
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
            for c, joint in enumerate(e.motion.joints):
                unit = "N" if e.body.tree.joints[c].kind == "prismatic" else "N*m"
                columns = (x[:, c] for x in (q, qd, e.measured, before, after))
                found.append(Trace(Path(e.motion.path).name, role, f"tau.{joint}", unit, time, *columns))
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
