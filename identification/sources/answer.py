"""What a decision says in numbers and words that all kinds of recordings share."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model
from ..decision.selection import Naming
from ..diagnosis import Candidate, ChannelFit, Estimate, Finding, Limit, Misfit, Rival
from ..reliability import of_name
from ..wording import experiment_sentence, rejection
from .decide import SourceDecision
from .fit import Covariances, deviations
from .source import Linearisation, ModelPoint, Source

Array = NDArray[np.float64]


def estimates(
    source: Source, given: ModelPoint, here: Linearisation, covariances: Covariances
) -> dict[str, dict[str, Estimate]]:
    """Parameters by the effect's key and their own name, the shifts free within their deviations."""
    spread, _ = deviations(source, given, here, covariances)
    std = dict(zip(here.at.keys, spread, strict=True))
    made: dict[str, dict[str, Estimate]] = {}
    for p in here.at.placed:
        made[p.key] = {}
        for x, value in zip(p.effect.parameters, map(float, here.at.of_effect(p)), strict=True):
            low, high = source.bounds(p, x)
            bound = x.name not in p.hold and min(value - low, high - value) < 1e-6 * source.size(p, x)
            own = float(std.get(f"{p.key}.{x.name}", 0.0))
            made[p.key][x.name] = Estimate(value, own, source.unit(p, x), bool(bound))
    return made


def finding(
    decided: SourceDecision,
    n: Naming,
    values: Mapping[str, Estimate],
    sentence: str,
    explained: float,
    either: Sequence[Rival] = (),
) -> Finding:
    """A name with its rivals; ``explained``: the share of the held-out residual's energy that goes with it; ``either``:
    exact aliases that no search has, each as likely.

    The posterior is shared among those that cannot be told apart; how often such a name is right was counted.
    """
    p, sure = n.placed, decided.best.missed[n.placed.key].sure
    right = of_name(n.gain, sure, explained)
    whole = n.share + sum(r.probability for r in n.rivals if not r.separable)
    scale = right / max(whole, 1e-12) / (1 + len(either))
    rivals = [
        Rival(r.placed.effect.name, r.placed.at, r.probability * (right if r.separable else scale), r.separable,
              experiment_sentence(p, r.placed))
        for r in n.rivals
    ]  # fmt: skip
    rivals += [replace(r, probability=n.share * scale) for r in either]
    return Finding(p.effect.name, p.at, sure, n.share * scale, dict(values), sentence, tuple(rivals), n.gain)


def with_found(model: Model, at: ModelPoint) -> Model:
    """The model with effects and their values."""
    placed = {p.key: p for p in model.effects} | {p.key: p for p in at.placed}
    return replace(model, effects=tuple(placed.values()), values={**model.values, **at.all_values})


def rms(linear: Linearisation) -> Array:
    """RMS of what is left of each channel (c,) in all recordings together."""
    return np.sqrt(np.mean(np.concatenate(linear.residuals) ** 2, axis=0))


def channel_fits(
    decided: SourceDecision,
    channels: Sequence[str],
    units: Sequence[str],
    train: Array,
    held: Array,
    floors: Sequence[float],
) -> tuple[ChannelFit, ...]:
    """Errors of every channel before and after; ``train``, ``held``: what they are relative to (c,)."""

    def misfit(before: Linearisation, after: Linearisation, sizes: Array, c: int) -> Misfit:
        a, b, size = float(rms(before)[c]), float(rms(after)[c]), float(sizes[c])
        return Misfit(a, b, a / size, b / size)

    found = decided.found
    return tuple(
        ChannelFit(
            name,
            unit,
            misfit(found.first.train, decided.train, train, c),
            misfit(decided.before, decided.held, held, c),
            f,
        )
        for c, (name, unit, f) in enumerate(zip(channels, units, floors, strict=True))
    )


def candidates(decided: SourceDecision) -> tuple[Candidate, ...]:
    """Every effect by itself on top of the model as given."""
    named = {n.placed.key for n in decided.best.names}
    return tuple(
        Candidate(t.placed.effect.name, t.placed.at, t.explained, t.odds, t.placed.key in named)
        for t in decided.found.trials
    )


def limits(source: Source, decided: SourceDecision) -> tuple[Limit, ...]:
    """What would have been named, had it been there."""
    named = {n.placed.key for n in decided.best.names}
    return tuple(
        Limit(t.placed.effect.name, t.placed.at, x.name, t.smallest[x.name], source.unit(t.placed, x))
        for t in decided.found.trials
        if t.placed.key not in named
        for x in t.placed.effect.parameters
        if x.name in t.smallest and t.smallest[x.name] <= source.bounds(t.placed, x)[1]
    )


def not_confirmed(decided: SourceDecision) -> list[str]:
    """Names that only the training recordings asked for, in words."""
    named = {n.placed.key for n in decided.best.names}
    return [rejection(n.placed) for n in decided.rejected if n.placed.key not in named]
