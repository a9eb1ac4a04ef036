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
from .choice import Taken, choose, is_all, weigh, widest
from .closed_loop import planned
from .passing import all_passing
from .rest import fitted
from .screening import Screening, screen

Array = NDArray[np.float64]

WORSE = 1.05
"""Ratio of a channel's residuals, with something more and without, that no good optimum has."""

MOST_ROUNDS = 8


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
        passing = [j for j in all_passing(result, model.joints) if j.placed.key not in barred]
        news = [(j, wide) for j in choose(result, passing) if (wide := widest(j, taken)) is not None]
        if not news:
            break
        chosen = [wide for _, wide in news]
        weighed = [weigh(result, j, passing, seed) for j, _ in news]
        for new, wide in zip(weighed, chosen, strict=True):
            gone = {t.judged.placed.key for t in taken if is_all(wide, t.judged)} | {wide.placed.key}
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
        found = refitted(found, assembly, fitted(assembly, experiments), rings, seed)
        instruments = planned(found, experiments, instruments)
        result = screen(model, found, experiments, instruments, opening.noise, seed, _in_round(number, progress))
    return Found(first, model, found, tuple(taken), opening, result, tuple(instruments))


def refitted(before: Fit, assembly: Assembly, samples: Sequence[Experiment], everywhere: bool, seed: int) -> Fit:
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
