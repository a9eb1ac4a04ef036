"""One joint's encoders in words and numbers: what is named, what would have been seen, what is left without a name."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.effects import effects
from ...models.model import Placed
from ..diagnosis import Candidate, Estimate, Finding, Limit, Rival, Trace
from ..reliability import probability as reliability
from ..wording import experiment_sentence, percent
from .diagnose import LinkDiagnosis, Proof
from .pair import Pair, PairFit, deviations

Array = NDArray[np.float64]


NAMELESS = 0.1
"""Smooth curves that explain this share of the difference, in blocks they did not see, mean a nameless effect."""

EITHER = ("sensor_gain", "sensor_drift", "sensor_bias")
"""Faults that either of the two encoders may have."""


def length(value: float, unit: str) -> str:
    """A small length or angle in words, in thousandths of its unit."""
    return f"{1e3 * value:.3g} m{unit}"


def unit_of(pair: Pair) -> str:
    """The joint's position unit."""
    return "m" if pair.kind == "prismatic" else "rad"


def _estimates(link: LinkDiagnosis, placed: Placed) -> dict[str, Estimate]:
    found = link.steps[-1]
    span, std = found.parameters(placed), deviations(link.pair, found)
    made = {}
    for p, value, s in zip(placed.effect.parameters, found.theta[span], std[span], strict=True):
        low, high = link.pair.bounds(p)
        bound = bool(value - low <= 1e-6 * abs(value) or high - value <= 1e-6 * abs(value))
        made[p.name] = Estimate(float(value), float(s), link.pair.unit(p), bound)
    return made


def findings_of(links: Sequence[LinkDiagnosis]) -> tuple[Finding, ...]:
    """What was named first at each joint goes first, and of these what explains most."""
    ranked = [
        (depth, -proof.named.trial.explained, _finding(link, proof))
        for link in links
        for depth, proof in enumerate(link.proofs)
    ]
    ranked.sort(key=lambda x: x[:2])
    return (*(f for _, _, f in ranked), *(f for link in links for f in _offset(link)))


def _offset(link: LinkDiagnosis) -> list[Finding]:
    found = []
    if link.offset is not None:
        effect, at = effects()["sensor_bias"], f"q_link.{link.pair.joint}"
        unit = unit_of(link.pair)
        without, within = (length(x, unit) for x in (link.offset.without, link.offset.within))
        sentence = (
            f"{effect.sentence[:1].upper()}{effect.sentence[1:]}: in every recording the link encoder's zero stands "
            f"off the motor's by the same {length(link.offset.value, unit)}; without it the held-out recording is "
            f"missed by {without}, with it by {within}. It explains nothing that moves."
        )
        estimate = Estimate(link.offset.value, link.offset.std, unit)
        rival = _either(link.pair, Placed(effect, at), reliability(1.0) / 2)
        found.append(Finding(effect.name, at, 0.5, reliability(1.0) / 2, {"offset": estimate}, sentence, (rival,)))
    return found


def _finding(link: LinkDiagnosis, proof: Proof) -> Finding:
    named, unit = proof.named, unit_of(link.pair)
    placed = named.trial.placed
    right = reliability(named.margin)
    rivals = [
        Rival(p.effect.name, p.at, w * right, separable, experiment_sentence(placed, p))
        for p, w, separable in named.rivals
        if w >= 0.005 or not separable
    ]
    margin = named.margin
    if placed.effect.name in EITHER:
        # Which of the two encoders is off, the two cannot tell.
        margin /= 2
        rivals.append(_either(link.pair, placed, margin * right))
    text = placed.effect.sentence
    evidence = (
        f"{text[:1].upper()}{text[1:]}: it explains {percent(named.trial.explained)} of what motor and link encoder of "
        f"{link.pair.joint} so far differed by; taking it out again raises the difference left on the held-out "
        f"recording from {length(proof.within, unit)} to {length(proof.without, unit)}.{_twist(link, placed)}"
    )
    return Finding(
        placed.effect.name, placed.at, margin, margin * right, _estimates(link, placed), evidence, tuple(rivals)
    )


def _twist(link: LinkDiagnosis, placed: Placed) -> str:
    """How far a drive twists, beside what it does not explain."""
    if placed.effect.acts_on != "position":
        return ""
    found = link.steps[-1]
    parameters = found.theta[found.parameters(placed)]
    twist = np.concatenate([run.term(placed, parameters)[0] for run in link.pair.runs])
    return f" The drive twists over {length(float(np.ptp(twist)), unit_of(link.pair))} in all."


def _either(pair: Pair, placed: Placed, probability: float) -> Rival:
    return Rival(
        placed.effect.name,
        f"q.{pair.joint}",
        probability,
        False,
        f"hold either encoder of {pair.joint} against a third measurement, such as a laser tracker's",
    )


def noise_floor(link: LinkDiagnosis) -> float:
    """RMS in the analysis band of white noise as strong as the raw difference above twice that band."""
    floors = []
    for run in link.pair.runs:
        longest = max(run.motion.segments, key=lambda s: s.stop - s.start)
        part = run.motion.tau[longest, run.joint]
        part = (part - np.mean(part)) * np.hanning(len(part))
        frequency = np.fft.rfftfreq(len(part), run.motion.period)
        density = np.abs(np.fft.rfft(part)) ** 2 / (0.375 * len(part)) * 2 * run.motion.period
        top = frequency > min(2 * run.motion.band, 0.4 / run.motion.period)
        # The median of a periodogram is ln 2 of its mean, and is not moved by single lines.
        floors.append(float(np.sqrt(np.median(density[top]) / np.log(2) * run.motion.band)))
    return min(floors)


def nameless(link: LinkDiagnosis) -> str:
    """What has no name, in words; empty where there is none, or no more than the encoders' noise."""
    size = float(np.sqrt(link.nameless * link.steps[-1].energy / len(link.steps[-1].residual)))
    if link.nameless < NAMELESS or size < 2 * noise_floor(link):
        return ""
    return (
        f"on q_link.{link.pair.joint}, smooth curves over position, speed, load and time together still explain "
        f"{percent(link.nameless)} of what is left between the encoders ({length(size, unit_of(link.pair))}) in blocks "
        f"that they were not fitted to"
    )


def candidates_of(link: LinkDiagnosis) -> list[Candidate]:
    """What each effect explains by itself of how the encoders differ, best first."""
    named = {p.named.trial.placed.key for p in link.proofs}
    trials = sorted(link.searched.opening, key=lambda t: -t.explained)
    return [
        Candidate(t.placed.effect.name, t.placed.at, float(t.explained), float(t.score), t.placed.key in named)
        for t in trials
        if t.explained > 0
    ]


def traces_of(link: LinkDiagnosis) -> list[Trace]:
    """How the encoders differ over time, measured, as given and after: for pictures."""
    made: list[Trace] = []
    sets: tuple[tuple[Literal["train", "holdout"], Pair, PairFit, PairFit], ...] = (
        ("train", link.pair, link.steps[0], link.steps[-1]),
        ("holdout", link.locked, link.held[0], link.held[-1]),
    )
    for role, pair, first, last in sets:
        at = 0
        for run in pair.runs:
            m = run.motion
            part = slice(at, at + len(run.measured))
            at = part.stop
            made.append(
                Trace(
                    Path(m.path).name,
                    role,
                    f"q_link.{pair.joint}",
                    unit_of(pair),
                    m.to_band(m.time),
                    m.to_band(m.q[:, run.joint]),
                    m.to_band(m.qd[:, run.joint]),
                    run.measured,
                    run.measured - first.residual[part],
                    run.measured - last.residual[part],
                )
            )
    return made


def limits_of(link: LinkDiagnosis) -> list[Limit]:
    """Smallest delay, gain error and drift, and softest spring, that these recordings would have shown."""
    pair, segments, whiten = link.pair, link.pair.segments, link.searched.whiten
    found = link.steps[-1]
    base = whiten(found.jacobian, segments)
    named = {p.effect.name for p in found.placed}
    columns = {
        "sensor_delay": [r.motion.qd[:, r.joint] for r in pair.runs],
        "sensor_gain": [r.motion.q[:, r.joint] for r in pair.runs],
        "sensor_drift": [r.motion.time - r.motion.time[0] for r in pair.runs],
        "joint_elasticity": [r.load for r in pair.runs],
    }
    made = []
    for name, parts in columns.items():
        if name in named:
            continue
        column = whiten(np.concatenate([r.motion.to_band(x) for r, x in zip(pair.runs, parts, strict=True)]), segments)
        rest = column - base @ np.linalg.lstsq(base, column, rcond=None)[0]
        needed = link.searched.bar + 0.5 * np.log(len(column))
        size = float(np.sqrt(2 * needed / max(float(rest @ rest), 1e-300)))
        effect = effects()[name]
        parameter = effect.parameters[0]
        at = pair.joint if effect.at == "joint" else f"q_link.{pair.joint}"
        made.append(Limit(name, at, parameter.name, 1 / size if effect.at == "joint" else size, pair.unit(parameter)))
    return made


def notes_of(link: LinkDiagnosis) -> list[str]:
    """Zeros of every recording, and what was not named, in words."""
    unit = unit_of(link.pair)
    zeros = ", ".join(length(z, "").removesuffix(" m") for z in (*link.steps[-1].zeros, *link.held[-1].zeros))
    notes = [
        f"zero of q_link.{link.pair.joint} against q.{link.pair.joint}, one recording after another: {zeros} m{unit}"
    ]
    notes += [
        f"{p.effect.name} at {p.at} passed on the training recordings but made the held-out one hardly better: "
        f"not named"
        for p in link.rejected
    ]
    words = nameless(link)
    return notes + ([f"without a name: {words}"] if words else [])
