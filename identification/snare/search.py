"""What a capture's model leaves out, by simulation in the loop: forward search over the effects that a snare can have.

A candidate is named under three conditions: the likelihood gained, minus ½ ln(numbers) for its parameter, is above what
the best of all candidates reaches by chance once in 200 diagnoses; it explains a share worth a name; and a held-out
capture is predicted better with it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...models.model import Model, PlacedEffect
from ..evidence.rival import RivalOdds
from .fit import CaptureFit, evaluate, fit, started, with_slopes
from .library import library, start_of
from .rivals import weigh
from .sets import CaptureSet
from .trials import CaptureTrial, try_all

CHANCE = 0.005
"""How often the best of all candidates may beat the bar by chance."""
EXPLAINED = 0.2
"""Share of the weighted residual energy that a name must explain: engines differ by some of it."""
ROUNDS = 4
"""Most effects that are named."""
CONFIRMED = 1.0
"""Least gain of the likelihood on the held-out captures."""
RIVAL = 0.2
"""A candidate with less than this share of the best one's score is no rival of it."""


@dataclass(frozen=True)
class CaptureNaming:
    """An effect that a search chose: its trial, how often it beat its rivals, these rivals, and the fits of the
    held-out captures before and after it.
    """

    trial: CaptureTrial
    margin: float
    rivals: tuple[RivalOdds, ...]
    held_before: CaptureFit
    held_after: CaptureFit


@dataclass(frozen=True)
class CaptureSelection:
    """The names; the fits of the model as given and of the last one; and these two on the held-out captures.

    ``opening`` has the first round's trials, ``rejected`` the effects that passed without being confirmed, ``bar`` the
    score that a candidate had to reach.
    """

    named: tuple[CaptureNaming, ...]
    first: CaptureFit
    last: CaptureFit
    held_first: CaptureFit
    held_last: CaptureFit
    opening: tuple[CaptureTrial, ...]
    rejected: tuple[PlacedEffect, ...]
    bar: float


def search(
    model: Model,
    train: CaptureSet,
    locked: CaptureSet,
    *,
    progress: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> CaptureSelection:
    """Add effects to a capture's model until no candidate is left that passes and is confirmed.

    Parameters
    ----------
    model : Model
    train, locked : CaptureSet
        Captures that are fitted and searched, and those held out.
    progress : callable
    seed : int
        Of the bootstrap.

    Raises
    ------
    InputError
        The model as given cannot be simulated.
    """
    progress(f"simulating {len(train.numbers)} captures with the model as given, and fitting its parameters")
    first = found = fit(train, start_at(model, train))
    held_first = held = demand_simulated(model, evaluate(locked, found.placed, [found.x])[0])
    pool = library(model)
    bar = float(np.log(max(len(pool), 1) / CHANCE))
    named: list[CaptureNaming] = []
    rejected: dict[str, PlacedEffect] = {}
    opening: tuple[CaptureTrial, ...] = ()
    for number in range(ROUNDS):
        have = {p.effect.name for p in found.placed}
        left = [p for p in pool if p.effect.name not in have]
        if not left:
            break
        trials = try_all(model, train, found, left, rejected, progress)
        opening = opening if number else trials
        passing = [t for t in trials if t.score > bar and t.explained > EXPLAINED and t.placed.key not in rejected]
        for trial in sorted(passing, key=lambda t: -t.score):
            progress(f"confirming {trial.placed.effect.name} on the held-out capture")
            (there,) = evaluate(locked, trial.fit.placed, [trial.fit.x])
            if there.likelihood > held.likelihood + CONFIRMED:
                break
            rejected[trial.placed.key] = trial.placed
        else:
            break
        rivals = [t for t in trials if t is not trial and t.score > RIVAL * trial.score]
        margin, odds = weigh(train.captures, trial, rivals, found, seed)
        named.append(CaptureNaming(trial, margin, odds, held, there))
        found, held = trial.fit, there
    found = with_slopes(train, found)
    return CaptureSelection(tuple(named), first, found, held_first, held, opening, tuple(rejected.values()), bar)


def start_at(model: Model, captures: CaptureSet) -> CaptureFit:
    """The model as given, simulated; raises InputError for a capture that cannot be."""
    return demand_simulated(model, started(captures, model.effects, start_of(model)))


def demand_simulated(model: Model, at: CaptureFit) -> CaptureFit:
    """The fit itself; raises InputError for a training or held-out capture that cannot be simulated."""
    if not np.isfinite(at.likelihood):
        raise InputError(
            f"{model.path}: the capture cannot be simulated from where the recording starts (the pin inside a cable, "
            "or steps that do not converge); check [capture] against the test's set-up"
        )
    return at
