"""Encoders in words and numbers: what is named, what is left without a name, noise, traces, notes."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...report.words import percent
from ..decision.selection import Naming
from ..diagnosis import Estimate, Finding, Rival, Trace
from ..sources.answer import estimates, finding, not_confirmed, rms
from ..sources.source import Linearisation
from ..sources.weigh import covariances
from .diagnose import EncoderComparison
from .source import Links

Array = NDArray[np.float64]


def length(value: float, unit: str) -> str:
    """A small length or angle in words, in thousandths of its unit."""
    return f"{1e3 * value:.3g} m{unit}"


def unit_of(links: Links, c: int) -> str:
    """A joint's position unit."""
    return "m" if links.kinds[c] == "prismatic" else "rad"


def findings_of(one: EncoderComparison) -> tuple[Finding, ...]:
    """Findings in order of held-out loss, the largest first; a constant difference comes last."""
    links, best = one.links, one.decided.best
    values = estimates(links, one.decided.given, one.decided.train, covariances(one.decided.found.weighed))
    order = sorted(best.names, key=lambda n: (links.still(n.placed), -best.missed[n.placed.key].gain))
    return tuple(_finding(one, n, values[n.placed.key]) for n in order)


def _finding(one: EncoderComparison, n: Naming, values: dict[str, Estimate]) -> Finding:
    links, p = one.links, n.placed
    c = links.channel(p)
    unit, joint = unit_of(links, c), links.joints[c]
    without, within = (float(rms(x)[c]) for x in (one.decided.best.missed[p.key].fit.held, one.decided.held))
    text = f"{p.effect.sentence[:1].upper()}{p.effect.sentence[1:]}: "
    if links.still(p):
        ((name, estimate),) = values.items()
        zeros, own = (links.zeros(x.at)[list(y), c] for x, y in ((one.decided.held, links.held),
                                                                 (one.decided.train, links.train)))  # fmt: skip
        # The recordings' own zeros tell it as far as they agree.
        spread = max(float(np.std(own, ddof=min(1, len(own) - 1))), float(rms(one.decided.train)[c]))
        values = {name: replace(estimate, std=spread / np.sqrt(len(own)))}
        without, within = (float(np.sqrt(within**2 + np.mean((zeros + x) ** 2))) for x in (estimate.value, 0.0))
        text += (
            f"in every recording the link encoder's zero differs from the motor encoder's by "
            f"{length(estimate.value, unit)}. Without it, the difference on the held-out recording is "
            f"{length(without, unit)}, with it {length(within, unit)}. It explains no motion."
        )
    else:
        share = max(0.0, 1 - (within / max(without, 1e-300)) ** 2)
        text += (
            f"it explains {percent(share)} of the difference of motor and link encoder of {joint}. Without it, the "
            f"remaining difference on the held-out recording rises from {length(within, unit)} to "
            f"{length(without, unit)}.{_twist(one, n)}"
        )
    # Of a fault that time does not tell apart, the two cannot say which of the two encoders is off.
    either = p.effect.at == "sensor" and not p.effect.states
    third = f"hold either encoder of {joint} against a third measurement, such as a laser tracker's"
    rivals = [Rival(p.effect.name, f"q.{joint}", 0.0, False, third)] if either else []
    return finding(one.decided, n, values, text, 1 - (within / max(without, 1e-300)) ** 2, rivals)


def _twist(one: EncoderComparison, n: Naming) -> str:
    """How far a drive twists, beside what it does not explain."""
    if n.placed.effect.acts_on != "position":
        return ""
    links, at = one.links, one.decided.train.at
    c = links.channel(n.placed)
    twist = [links.rows[i][c].term(n.placed, at.of_effect(n.placed))[0] for i in links.train]
    return f" The drive twists over {length(float(np.ptp(np.concatenate(twist))), unit_of(links, c))} in all."


def noise_floor(links: Links, c: int) -> float:
    """RMS in the analysis band of white noise as strong as the raw difference above twice that band."""
    floors = []
    for i in links.train:
        run = links.rows[i][c]
        longest = max(run.motion.segments, key=lambda s: s.stop - s.start)
        part = run.motion.tau[longest, run.joint]
        part = (part - np.mean(part)) * np.hanning(len(part))
        frequency = np.fft.rfftfreq(len(part), run.motion.period)
        density = np.abs(np.fft.rfft(part)) ** 2 / (0.375 * len(part)) * 2 * run.motion.period
        top = frequency > min(2 * run.motion.band, 0.4 / run.motion.period)
        # The median of a periodogram is ln 2 of its mean, and is not moved by single lines.
        floors.append(float(np.sqrt(np.median(density[top]) / np.log(2) * run.motion.band)))
    return min(floors)


def nameless(one: EncoderComparison) -> str:
    """Nameless curves in words; empty if there are none."""
    after = rms(one.decided.train)
    return "; ".join(
        f"on {one.links.channels[r.channel]}, a smooth curve over {r.over} still explains {percent(r.explained)} of "
        f"the remaining difference between the encoders "
        f"({length(float(np.sqrt(r.explained) * after[r.channel]), unit_of(one.links, r.channel))})"
        for r in one.decided.left.curves
    )


def traces_of(one: EncoderComparison) -> list[Trace]:
    """Difference of the encoders over time, measured, by the model as given and by the final one: for pictures."""
    links, decided = one.links, one.decided
    sets: tuple[tuple[Literal["train", "holdout"], Sequence[int], Linearisation, Linearisation], ...] = (
        ("train", links.train, decided.found.first.train, decided.train),
        ("holdout", links.held, decided.before, decided.held),
    )
    made: list[Trace] = []
    for c, channel in enumerate(links.channels):
        for role, numbers, before, after in sets:
            for i, a, b in zip(numbers, before.residuals, after.residuals, strict=True):
                run = links.rows[i][c]
                m, own = run.motion, run.measured
                columns = m.to_band(m.time), m.to_band(m.q[:, run.joint]), m.to_band(m.qd[:, run.joint])
                made.append(
                    Trace(
                        Path(m.path).name, role, channel, unit_of(links, c), *columns, own, own - a[:, c], own - b[:, c]
                    )
                )
    return made


def notes_of(one: EncoderComparison) -> list[str]:
    """Zeros of every recording, and what was not named, in words."""
    links, notes = one.links, []
    every = links.zeros(one.decided.train.at)[list(links.train)], links.zeros(one.decided.held.at)[list(links.held)]
    for c, joint in enumerate(links.joints):
        zeros = ", ".join(length(z, "").removesuffix(" m") for z in np.concatenate(every)[:, c])
        unit = unit_of(links, c)
        notes.append(f"zero of q_link.{joint} against q.{joint}, one recording after another: {zeros} m{unit}")
    words = nameless(one)
    return notes + not_confirmed(one.decided) + ([f"without a name: {words}"] if words else [])
