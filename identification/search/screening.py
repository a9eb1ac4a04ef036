"""One screening: every effect at every place and shape judged on top of a fit, and the noise they are judged
against."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, wilcoxon

from ...models.model import Model
from ..diagnosis import Limit
from ..fitting.assembly import Assembly
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit, channel_rms
from .candidates import library, refines, variants, widens
from .curves import nameless_columns, smooth_columns
from .evidence import Evidence
from .grounds import NULLS, Grounds, Readings, grounds, readings
from .judged import Judged, Samples
from .saturated import Noise, learn
from .trial import IDEALISED, MATERIAL, WIDER, WORTH, Null, Option, source, tried

Array = NDArray[np.float64]
T = TypeVar("T")

FEW = 16
"""Blocks up to which a mean and its standard error say little of gains that differ by orders of magnitude."""

LEVEL = 0.995
"""Quantile of the best score on noise that a candidate must beat, among all that reach the same channels."""


@dataclass(frozen=True)
class Nameless:
    """A nameless curve on a channel: what it runs over, in words; the share of the residual's energy that it explains
    in blocks that it was not fitted to; and the log-likelihood that it gains there."""

    over: str
    share: float
    gain: float


@dataclass(frozen=True)
class Screening:
    """Candidates best first, the score that noise alone reaches on each set of channels, and what nameless curves
    explain."""

    evidence: Evidence
    near_rest: Samples
    """Samples near rest too, on which some of the candidates were judged."""
    measured: Samples
    """Samples in motion beside a baseline from the motion as measured, on which some of the candidates were judged."""
    judged: tuple[Judged, ...]
    asked: Mapping[str, Judged]
    """Of drives judged along the motion as measured: the same along the motion that was asked for."""
    threshold: Mapping[tuple[int, ...], float]
    nameless: Mapping[int, Nameless]
    """The best curve of each channel that has one."""
    worth: Mapping[str, float]
    """Share of its channels' residual that each candidate must explain to be worth a name."""
    limits: tuple[Limit, ...]
    noise: Noise
    heard: Array
    """Share of each channel's residual energy that noise of the encoders accounts for (J,)."""


def screen(
    model: Model,
    found: Fit,
    experiments: Sequence[Experiment],
    instruments: Sequence[Experiment],
    noise: Noise | None,
    seed: int,
    progress: Callable[[str], None],
) -> Screening:
    """Judge every candidate on top of a fit.

    Parameters
    ----------
    model : Model
        With the effects of the fit.
    found : Fit
    experiments : sequence of Experiment
        Training recordings: their residuals are explained.
    instruments : sequence of Experiment
        The same with the motion that was asked for: columns come from these, so that no disturbance stands in them.
    noise : Noise or None
        From the first screening; None learns it.
    seed : int
        Of the sign-flipped nulls.
    progress : callable
        Told how far it is.
    """
    along = readings(found, experiments, instruments)
    every = [
        [(v, own) for v in variants(found.assembly, p) if (own := source(along, p.effect).columns(v))]
        for p in _told(library(model), "simulating each effect at each place", progress)
    ]
    pool = [options for options in every if options]
    if noise is None:
        noise = learn(along.measured.experiments, along.measured.residuals(), _saturated(along, pool))
    ground = grounds(along, noise, seed)
    null = Null({(c,): np.zeros(NULLS) for c in range(len(model.joints))})
    judging = _told(pool, "judging each effect at each place", progress)
    trials = [t for options in judging if (t := tried(ground, options, null)) is not None]
    threshold = {channels: float(np.quantile(x, LEVEL)) for channels, x in null.scores.items()}
    judged = sorted((t.best for t in trials), key=lambda j: -j.score)
    evidence = ground.asked.evidence
    worth = _worth(model, found, experiments, judged)
    limits = [
        limit
        for j in (t.best for t in trials)
        for limit in _limits(found.assembly, evidence, j, threshold[j.channels] + j.price, worth[j.placed.key])
    ]
    return Screening(
        evidence,
        ground.near_rest,
        ground.measured,
        tuple(judged),
        {t.asked.placed.key: t.asked for t in trials if t.asked is not None},
        threshold,
        _nameless(ground, threshold),
        worth,
        tuple(limits),
        noise,
        ground.heard,
    )


def _told(items: Sequence[T], words: str, progress: Callable[[str], None]) -> Iterator[T]:
    """The items, with a word at every tenth of them."""
    for number, item in enumerate(items):
        if number % -(-len(items) // 10) == 0:
            progress(f"{words}, {number} of {len(items)}")
        yield item


class _Free:
    """Amplitudes (k,) without bounds."""

    def __init__(self, k: int) -> None:
        self.high = np.full(k, np.inf)
        self.low = -self.high


def _nameless(ground: Grounds, threshold: Mapping[tuple[int, ...], float]) -> dict[int, Nameless]:
    """The curve without a name that explains most of each channel's residual afresh."""
    asked = ground.readings.asked
    sigma, log_size = asked.found.sigma, np.log(ground.asked.evidence.size)
    found: dict[int, Nameless] = {}
    for c in range(len(sigma)):
        for words, parts in nameless_columns(asked.experiments, asked.states, c).items():
            free = _Free(parts[0].shape[1])
            case = ground.asked.case(free, {c: parts})
            score = case.gain().total - 0.5 * len(free.high) * log_size
            if score <= threshold[(c,)]:
                continue
            spread = float(sigma[c])  # a curve is no taller than what is left over, before it is seen
            fresh = case.fresh_gains(spread)
            if reliably_positive(fresh):
                share = min(ground.asked.foreseen(free, {c: parts}, spread), 1.0)
                if share > (found[c].share if c in found else 0.0):
                    found[c] = Nameless(words, share, float(fresh.sum()))
    return found


def _worth(model: Model, found: Fit, experiments: Sequence[Experiment], judged: Sequence[Judged]) -> dict[str, float]:
    """`WORTH`, or more beside what is there: `IDEALISED` of what slings and booms do, and for what only changes the
    shape of a law `MATERIAL` of the torque. `WIDER` of what takes the place of a name that is there, and adds none."""
    left, measured = channel_rms(found.assembly, experiments, found.theta)
    left = np.maximum(left, 1e-300)
    idealised = (IDEALISED * _hung(found, experiments) / left) ** 2
    material = (MATERIAL * measured / left) ** 2
    worth = {}
    for j in judged:
        reached = list(j.channels)
        part = float(material[reached].min()) if refines(model, j.placed) else 0.0
        least = WIDER if widens(model, j.placed) else WORTH
        worth[j.placed.key] = max(least, part, float(idealised[reached].mean()))
    return worth


def _hung(found: Fit, experiments: Sequence[Experiment]) -> Array:
    """RMS torque of what slings and booms do in the analysis band, one beside the other (J,)."""
    assembly = found.assembly
    energy = np.zeros(len(assembly.tree.joints))
    for p in assembly.placed:
        if p.effect.at in ("sling", "boom"):
            bare = assembly.keep([x for x in assembly.placed if x is not p], found.theta)
            parts = [e.all_to_band(assembly.torque(e, found.theta) - bare.torque(e, bare.start)) for e in experiments]
            energy += np.mean(np.concatenate(parts) ** 2, axis=0)
    return np.sqrt(energy)


def _limits(assembly: Assembly, evidence: Evidence, j: Judged, needed: float, worth: float) -> list[Limit]:
    """The smallest that each of an effect's amplitudes would have had to be, by itself, to pass."""
    tried = [j.placed.effect.parameters[i] for i in j.variant.amplitudes]
    # Both bars count: a score above noise, and a share of the residual worth a name.
    energy = sum(float(np.sum(evidence.channels[c].residual ** 2)) for c in j.channels)
    products, needed = evidence.products(list(j.columns.items())), max(needed, 0.5 * worth * energy)
    return [
        Limit(
            j.placed.effect.name,
            j.placed.at,
            p.name,
            evidence.smallest(products, k, needed),
            assembly.unit(j.placed, p),
        )
        for k, p in enumerate(tried)
        if p.alone and not p.grid
    ]


def reliably_positive(gains: Array, errors: float = 2.0) -> bool:
    """Is what is gained on blocks left out above zero?

    Its mean by so many standard errors (two: one-sided 2.5 %), with all blocks or without the best and the worst: one
    may be where no other has been. Or, of `FEW`, by the signs and ranks (Wilcoxon 1945): where one or two gain a
    hundred times what the others do, their scatter is no reason to doubt the others.
    """
    inner = np.sort(gains)[1:-1]
    some = [gains, inner] if len(inner) > 2 else [gains]
    if any(bool(np.mean(x) > errors * np.std(x, ddof=1) / np.sqrt(len(x))) for x in some):
        return True
    # Wilcoxon's test drops zeros; with any among them SciPy would go through all signs one by one.
    moved = gains[gains != 0]
    return bool(len(moved) > 0 and len(gains) <= FEW and wilcoxon(moved, alternative="greater")[1] < norm.sf(errors))


def _saturated(along: Readings, pool: Sequence[Sequence[Option]]) -> list[Array]:
    """Everything that could explain each channel: baseline, smooth curves, a middle variant of each candidate."""
    asked = along.asked
    columns = []
    for c, own in enumerate(asked.baseline()):
        smooth = smooth_columns(asked.experiments, asked.states, c)
        columns.append([np.concatenate([x for _, x in own]), np.concatenate(smooth)])
    for options in pool:
        for c, parts in options[len(options) // 2][1].items():
            columns[c].append(np.concatenate(parts))
    return [np.concatenate(own, axis=1) for own in columns]
