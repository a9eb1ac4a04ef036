"""Forward search: which effects, at which places, the recordings ask for; one joint refit after every round.

A candidate is judged on whitened samples with the whole baseline fitted again beside it. It is taken when

1. its score (log-likelihood gained less ½ log(samples) for each parameter) beats the best score that *any* candidate
      on the same channels reaches on noise alone (over sign-flipped nulls, the 99.5 % quantile of the maximum);
2. fitted without a time block, it predicts that block better than the baseline, over all blocks;
3. it explains a share of its channels' residual energy that is worth a name.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, Placed
from ..fitting.assembly import Assembly
from ..fitting.base_parameters import BaseParameters
from ..fitting.experiment import Experiment, Scales
from ..fitting.fit import Fit, channel_rms, fit
from .closed_loop import DRIVEN, planned
from .encoder_noise import UNEVEN
from .evidence import ABSORBED
from .judged import Judged
from .rest import fitted
from .screening import Screening, reliably_positive, screen
from .trial import WORTH

Array = NDArray[np.float64]

ALIKE = 0.98
"""Cosine from which on two effects explain the same."""

TIE = 2.0
"""Difference of two scores that says nothing."""

AS_GOOD = 0.1
"""Difference of two scores in a bootstrap that is none: twins explain the same to the last digits."""

AHEAD = 1.15
"""Ratio of scores up to which a special case is preferred to what contains it."""

WORSE = 1.05
"""Ratio of a channel's residuals, with something more and without, that no good optimum has."""

MOST_ROUNDS = 8
BOOTSTRAPS = 400


@dataclass(frozen=True)
class RivalOdds:
    """A rival of an effect: how often it won the bootstrap, and whether these recordings can tell the two apart."""

    placed: Placed
    probability: float
    separable: bool


@dataclass(frozen=True)
class Taken:
    """An effect that the search took, with how often it beat every rival in a bootstrap over time blocks, and the
    log-likelihood that it gained in blocks left out, together with what has become part of it."""

    judged: Judged
    probability: float
    rivals: tuple[RivalOdds, ...]
    gained: float


@dataclass(frozen=True)
class Found:
    """Baseline fit, model with all that was taken and its fit, first and last screening."""

    first: Fit
    model: Model
    fit: Fit
    taken: tuple[Taken, ...]
    opening: Screening
    closing: Screening
    instruments: tuple[Experiment, ...]


def assemble(model: Model, base: BaseParameters | None, scales: Mapping[str, Scales]) -> Assembly:
    """Parameters and torque of a model, started from the values it has."""
    return Assembly(model.tree, model.effects, base, scales, model.values)


def search(
    model: Model,
    base: BaseParameters | None,
    scales: Mapping[str, Scales],
    experiments: Sequence[Experiment],
    *,
    before: Found | None = None,
    barred: Collection[str] = (),
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Found:
    """Add effects to a model until no candidate is left that passes.

    Parameters
    ----------
    model : Model
        Baseline.
    base : BaseParameters or None
        With ``inertia = "free"``.
    scales : mapping of str to Scales
    experiments : sequence of Experiment
        Training recordings.
    before : Found, optional
        An earlier search of the same: its baseline and first screening are not done again.
    barred : collection of str
        Keys of effects and places that must not be taken.
    progress : callable
        Told in a few words what is under way.
    seed : int
    """
    taken: list[Taken] = []
    if before is None:
        progress("fitting the baseline")
        assembly = assemble(model, base, scales)
        first = found = fit(assembly, fitted(assembly, experiments), progress=progress, seed=seed)
        instruments = planned(found, experiments)
        opening = result = screen(model, found, experiments, instruments, None, seed, _in_round(1, progress))
    else:
        first = found = before.first
        opening = result = before.opening
        instruments = before.instruments
    for number in range(2, MOST_ROUNDS + 2):
        passing = [j for j in _passing(result, model.joints) if j.placed.key not in barred]
        news = [(j, wide) for j in _choose(result, passing) if (wide := _widest(j, taken)) is not None]
        if not news:
            break
        chosen = [wide for _, wide in news]
        weighed = [_weigh(result, j, passing, seed) for j, _ in news]
        for new, wide in zip(weighed, chosen, strict=True):
            gone = {t.judged.placed.key for t in taken if _is_all(wide, t.judged)} | {wide.placed.key}
            # What has become part of something wider speaks for it; what explained more speaks louder.
            together = [new, *(t for t in taken if t.judged.placed.key in gone)]
            strongest = max(together, key=lambda t: t.judged.score)
            rivals = tuple(r for r in strongest.rivals if r.placed.key not in gone)
            taken = [t for t in taken if t.judged.placed.key not in gone]
            taken.append(Taken(wide, strongest.probability, rivals, sum(t.gained for t in together)))
            model = replace(model, effects=tuple(p for p in model.effects if p.key not in gone))
        start = {key: value for j in chosen for key, value in j.start().items()}
        model = model.with_effects([j.placed for j in chosen], start)
        progress("refitting with " + ", ".join(f"{j.placed.effect.name} at {j.placed.at}" for j in chosen))
        assembly = assemble(model, base, scales)
        # What rings has a local optimum at many a frequency; the screening's columns leave its damping where it is.
        rings = any(j.placed.effect.at == "base" and j.placed.effect.states for j in chosen)
        found = _refitted(found, assembly, fitted(assembly, experiments), rings, seed)
        instruments = planned(found, experiments, instruments)
        result = screen(model, found, experiments, instruments, opening.noise, seed, _in_round(number, progress))
    return Found(first, model, found, tuple(taken), opening, result, tuple(instruments))


def _refitted(before: Fit, assembly: Assembly, samples: Sequence[Experiment], everywhere: bool, seed: int) -> Fit:
    """The fit of a model that has something more; from many starts if it was to be, or if one ended badly.

    What it had before is a special case of it, so that it leaves no more, unless it ended in a bad optimum.
    """
    found = fit(assembly, samples, start=carry(before, assembly), multi_start=everywhere, seed=seed)
    if everywhere:
        return found
    with_it, without_it = (channel_rms(f.assembly, samples, f.theta)[0] for f in (found, before))
    if np.all(with_it <= WORSE * without_it):
        return found
    return fit(assembly, samples, start=carry(before, assembly), multi_start=True, seed=seed)


def _in_round(number: int, progress: Callable[[str], None]) -> Callable[[str], None]:
    """Progress that says in which round."""
    return lambda words: progress(f"round {number}: {words}")


def carry(found: Fit, assembly: Assembly) -> Array:
    """A fit's parameters in another assembly's order; what is new there starts where that assembly says."""
    known = {s.key: v for s, v in zip(found.assembly.slots, found.theta, strict=True)}
    return np.array([known.get(s.key, s.start) for s in assembly.slots])


def without(found: Fit, placed: Placed) -> Assembly:
    """The same model with one effect taken out again."""
    return found.assembly.keep([p for p in found.assembly.placed if p.key != placed.key], found.theta)


def _passing(result: Screening, joints: Sequence[str]) -> list[Judged]:
    """Candidates that pass every test, best first; what acts at a joint finds its channel among ``joints``."""
    passing = [j for j in result.judged if _passes(result, j)]
    for j in [j for j in passing if _near_rest(result, j)]:
        # Scores on different samples do not compare: those that beat it on its own go first.
        others = [o for o in passing if o is not j and set(o.channels) == set(j.channels)]
        better = [o for o in others if _same_samples(result, j, o).score > j.score]
        passing.remove(j)
        passing.insert(max((passing.index(o) + 1 for o in better), default=0), j)
    # What disturbances could have driven, if nothing else, is named where nothing else is.
    driven = [j for j in passing if _as_measured(result, j)]
    first = [j for j in passing if j not in driven]
    alone = [j for j in driven if not any(joints.index(j.placed.at) in o.channels for o in first)]
    return _untied(result, [*first, *alone])


def _passes(result: Screening, j: Judged) -> bool:
    """Does a candidate pass every test?"""
    # What a disturbance drives is let into the motion up to a share, and looks like a late sensor.
    late = j.placed.effect.at == "sensor" and bool(j.placed.effect.states)
    worth = max(result.worth[j.placed.key], DRIVEN if late else 0.0)
    if late and j.placed.at.startswith("tau."):
        # A torque that comes late follows the noise of the motion least, and is nearer to the measured one for that.
        worth = max(worth, WORTH + UNEVEN * float(result.heard[j.channels[0]]))
    if j.score <= result.threshold[j.channels] or j.explained < worth:
        return False
    return reliably_positive(j.case.fresh_gains())


def _as_measured(result: Screening, j: Judged) -> bool:
    """Does a drive's spring or play pass along the motion as measured, and not along what was asked for?"""
    if j.case.evidence is not result.measured.evidence or j.placed.effect.acts_on != "position":
        return False
    asked = result.asked.get(j.placed.key)
    return asked is None or not _passes(result, asked)


def _untied(result: Screening, passing: list[Judged]) -> list[Judged]:
    """Twins, which explain the same in motion and as well, in the order of what they explain near rest, too.

    That is weak evidence, since a joint that sticks may hold anything; it only orders what nothing else does. Where it
    says nothing either, a faulty sensor comes first: it is the first to be ruled out on a rig.
    """
    for k in range(len(passing)):
        j = passing[k]
        if _near_rest(result, j):
            continue
        twins = [
            o
            for o in passing[k + 1 :]
            if o.channels == j.channels
            and not _near_rest(result, o)
            and j.score - o.score < TIE
            and result.evidence.likeness(j.signal(), o.signal()) > ALIKE
        ]
        if twins:
            alike = {id(o): o.among(result.near_rest).score for o in (j, *twins)}
            likely = [o for o in (j, *twins) if alike[id(o)] > max(alike.values()) - TIE]
            best = max(likely, key=lambda o: (o.placed.effect.family == "measurement", alike[id(o)]))
            passing.remove(best)
            passing.insert(k, best)
    return passing


def _same_samples(result: Screening, j: Judged, other: Judged) -> Judged:
    """The other candidate on the samples that the first was judged on."""
    return other if _near_rest(result, other) or not _near_rest(result, j) else other.among(result.near_rest)


def _near_rest(result: Screening, j: Judged) -> bool:
    """Was it judged on samples near rest, too?"""
    return j.case.evidence is result.near_rest.evidence


def _is_all(wide: Judged, other: Judged) -> bool:
    """Is an effect all that another one at its place is, and more? Levels of friction add up instead."""
    effect = wide.placed.effect
    contained = wide.placed.at == other.placed.at and other.placed.effect.name in effect.contains
    return contained and effect.family != "joint friction"


def _widest(new: Judged, taken: Sequence[Taken]) -> Judged | None:
    """A candidate, or what was taken before if it is all that; with every parameter free. None where it is already."""
    for old in (t.judged for t in taken):
        for wide, part in ((new, old), (old, new)):
            if _is_all(wide, part):
                if wide is old and not old.placed.hold:
                    return None
                return replace(wide, placed=replace(wide.placed, hold=()))
    return new


def _choose(result: Screening, passing: Sequence[Judged]) -> list[Judged]:
    """The best candidate, and beside it the best on every channel that no better candidate reaches."""
    scores = {j.placed.key: j.score for j in passing}
    best: dict[int, Judged] = {}
    for j in passing:
        if len(j.channels) == 1:
            best.setdefault(j.channels[0], j)
    chosen: list[Judged] = []
    reached: set[int] = set()
    for j in passing:
        special = [scores.get(f"{name}.{j.placed.at}", -np.inf) for name in j.placed.effect.contains]
        if j.score < AHEAD * max(special, default=-np.inf):
            continue  # a special case of it passes too, explains nearly as much, and goes first
        local = [best[c] for c in j.channels if c in best]
        if len(j.channels) > 1 and local and not _worth_its_reach(result, j, local):
            continue
        if reached.isdisjoint(j.channels):
            chosen.append(j)
        reached |= set(j.channels)
    return chosen


def _worth_its_reach(result: Screening, wide: Judged, local: Sequence[Judged]) -> bool:
    """Is an effect that reaches several channels, with the local ones it leaves a need for, a better story than the
    best local effects of those channels together?"""
    alone = _together(result, [wide])
    beside = [j for j in local if _together(result, [wide, j]) - alone > result.threshold[j.channels]]
    return _together(result, [wide, *beside]) >= _together(result, local)


def _together(result: Screening, several: Sequence[Judged]) -> float:
    """Score of several candidates at once."""
    reached = sorted({c for j in several for c in j.channels})
    size = {c: len(result.evidence.channels[c].residual) for c in reached}
    columns = [
        (c, np.hstack([j.columns.get(c, np.zeros((size[c], len(j.variant.low)))) for j in several])) for c in reached
    ]
    low, high = (np.concatenate([getattr(j.variant, side) for j in several]) for side in ("low", "high"))
    gain = result.evidence.gain(result.evidence.products(columns), low, high, ABSORBED)
    return gain.total - sum(j.price for j in several)


def _weigh(result: Screening, best: Judged, passing: Sequence[Judged], seed: int) -> Taken:
    """Bootstrap over time blocks: how often does each candidate on these channels beat all others?"""
    evidence = result.evidence

    def contradicts(j: Judged) -> bool:
        """What contains the effect as a special case does not; of a link's mass, it may be the whole truth."""
        if best.placed.effect.name not in j.placed.effect.contains or best.placed.at != j.placed.at:
            return True
        return best.placed.effect.at == "link" and evidence.likeness(best.signal(), j.signal()) > ALIKE

    rivals = [best] + [
        j
        for j in passing
        if j is not best and set(j.channels) & set(best.channels) and j.score > 0.2 * best.score and contradicts(j)
    ]
    rivals = rivals[:8]
    near_rest = any(_near_rest(result, j) for j in rivals)
    alike = [j.among(result.near_rest) if near_rest else j for j in rivals]
    # As in the choice: what has more freedom must explain plainly more, at whatever link.
    wide = [best.placed.effect.at == "link" and best.placed.effect.name in j.placed.effect.contains for j in rivals]
    gains = np.array([j.case.shares() / (AHEAD if w else 1.0) for j, w in zip(alike, wide, strict=True)])
    price = np.array([j.price for j in rivals])
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(evidence.n_blocks, np.full(evidence.n_blocks, 1 / evidence.n_blocks), BOOTSTRAPS)
    scores = counts @ gains.T - price
    # Those as good as the best share a win; and half a win more than seen for each: no bootstrap makes certain.
    winners = scores > scores.max(axis=1, keepdims=True) - AS_GOOD
    wins = (np.sum(winners / winners.sum(axis=1, keepdims=True), axis=0) + 0.5) / (BOOTSTRAPS + 0.5 * len(rivals))
    others = [
        RivalOdds(j.placed, float(w), bool(w < 0.05 and evidence.likeness(best.signal(), j.signal()) < ALIKE))
        for j, w in zip(rivals[1:], wins[1:], strict=True)
    ]
    others.sort(key=lambda r: -r.probability)
    return Taken(best, float(wins[0]), tuple(others[:4]), float(best.case.fresh_gains().sum()))
