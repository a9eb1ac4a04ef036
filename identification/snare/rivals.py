"""How sure a name is: a bootstrap over time blocks of the recordings says how often it beats the other candidates."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ..deciding import ALIKE
from ..evidence.rival import RivalOdds
from ..reliability import BOOTSTRAPS
from .comparison import LONG, SLOW, Blocks, variances
from .fit import CaptureFit
from .recording import CaptureRecording
from .trials import CaptureTrial

Array = NDArray[np.float64]

STRETCH = 4
"""Slow means (1 s) in a time block."""


def weigh(
    captures: Sequence[CaptureRecording],
    best: CaptureTrial,
    others: Sequence[CaptureTrial],
    before: CaptureFit,
    seed: int,
) -> tuple[float, tuple[RivalOdds, ...]]:
    """How often a trial beats all others, and how often each of these does, likeliest first.

    The recordings tell two apart where a rival hardly ever wins and changes the simulation in another way.
    """
    by = variances(captures, best.fit.residuals)
    trials = [best, *others]
    gains = np.array([_by_time(before.residuals, by) - _by_time(t.fit.residuals, by) for t in trials])
    rng = np.random.default_rng(seed)
    n = gains.shape[1]
    winners = np.argmax(rng.multinomial(n, np.full(n, 1 / n), BOOTSTRAPS) @ gains.T, axis=1)
    # Half a win more than seen for each: no bootstrap is evidence of certainty.
    wins = (np.bincount(winners, minlength=len(trials)) + 0.5) / (BOOTSTRAPS + 0.5 * len(trials))
    mine = _signal(before, best.fit, by)
    odds = []
    for trial, won in zip(others, wins[1:], strict=True):
        signal = _signal(before, trial.fit, by)
        alike = float(mine @ signal) / max(float(np.linalg.norm(mine) * np.linalg.norm(signal)), 1e-300)
        odds.append(RivalOdds(trial.placed, float(won), bool(won < 0.05 and alike < ALIKE)))
    return float(wins[0]), tuple(sorted(odds, key=lambda r: -r.probability))


def _by_time(residuals: Sequence[Blocks], by: Mapping[str, float]) -> Array:
    """½ weighted residual energy of every second of every capture."""
    found = []
    for own in residuals:
        energy = np.zeros(-(-max(len(r) * _quarters(name) for name, r in own.items()) // STRETCH))
        for name, r in own.items():
            each = 0.5 * np.sum(r**2, axis=1) / by[name]
            second = np.arange(len(each)) // (STRETCH // _quarters(name))
            energy += np.bincount(np.minimum(second, len(energy) - 1), each, len(energy))
        found.append(energy)
    return np.concatenate(found)


def _quarters(block: str) -> int:
    """Quarter seconds that a number of a block stands for."""
    return LONG // SLOW if block.startswith("chatter") else 1


def _signal(before: CaptureFit, after: CaptureFit, by: Mapping[str, float]) -> Array:
    """What a candidate changes, whitened by the scales, end to end."""
    pairs = zip(before.residuals, after.residuals, strict=True)
    return np.concatenate([((a[name] - b[name]) / by[name] ** 0.5).ravel() for a, b in pairs for name in a])
