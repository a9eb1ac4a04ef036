"""One round of the search over a capture's effects: every candidate tried, the best few fitted.

Each candidate is tried at a few values beside what the model has; the likelihood that this would reach, once the
model's own parameters have moved, is expected from their derivatives. The best few are fitted together with everything
else.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, PlacedEffect
from .comparison import Blocks, price, variances
from .fit import CaptureFit, evaluate, fit, step_from, with_slopes
from .handles import bounds, handle_of, steps, values_of
from .library import absent
from .recording import CaptureRecording
from .sets import CaptureSet

Array = NDArray[np.float64]

FITTED = 3
"""Candidates of a round that are fitted."""
HOPE = 2.0
"""A candidate that is expected to lose more of the likelihood is not fitted."""
FORESIGHT = 4.0
"""How far derivatives are believed where no simulation follows, in units of the differences."""


@dataclass(frozen=True)
class CaptureTrial:
    """A candidate on top of a model: its fit, and the share of the weighted residual energy that it explains.

    ``score`` is the likelihood gained less the price of a parameter.
    """

    placed: PlacedEffect
    fit: CaptureFit
    score: float
    explained: float


def try_all(
    model: Model,
    captures: CaptureSet,
    found: CaptureFit,
    candidates: Sequence[PlacedEffect],
    rejected: Collection[str],
    progress: Callable[[str], None],
) -> tuple[CaptureTrial, ...]:
    """Try all candidates beside a fit, and fit the best few; best expected first.

    Parameters
    ----------
    model : Model
    captures : CaptureSet
        Those that are fitted.
    found : CaptureFit
        Of the model with what was named so far.
    candidates : sequence of PlacedEffect
    rejected : collection of str
        Keys of candidates that are not worth a fit.
    progress : callable
    """
    if found.slopes is None:
        found = with_slopes(captures, found)
    places = {p.key: [np.append(found.x, handle_of(p).x(v)) for v in handle_of(p).tries] for p in candidates}
    progress(f"trying {len(candidates)} effects at {sum(map(len, places.values()))} values in simulation")
    # All are asked for at once, so that the processes share them; what was run is remembered.
    captures.tracks_at([values_of((*found.placed, p), x) for p in candidates for x in places[p.key]])
    entries = []
    for p in candidates:
        tries = evaluate(captures, (*found.placed, p), places[p.key])
        entries.append((*_most_hopeful(captures.captures, found, tries), p, tries))
    trials = []
    for rank, (expected, best, p, tries) in enumerate(sorted(entries, key=lambda e: -e[0])):
        hopeful = expected > found.likelihood - HOPE and np.isfinite(best.likelihood)
        if rank < FITTED and hopeful and p.key not in rejected:
            progress(f"fitting {p.effect.name} at {p.at} together with the model's effects")
            best = _joint(captures, found, [f for f in tries if f.residuals], absent(model, p))
        score = float(best.likelihood - found.likelihood - price(found.residuals))
        trials.append(CaptureTrial(p, best, score, _explained(captures.captures, found, best)))
    return tuple(trials)


def _joint(captures: CaptureSet, found: CaptureFit, tried: Sequence[CaptureFit], nothing: float) -> CaptureFit:
    """Fit a candidate with everything, from the best of its tries and of four more on either side of that.

    Its first derivative is the secant to the nearest of them, or to its absence, where its handle is at ``nothing``:
    likelihood has more than one top over it, where forces swing in and out of step.
    """
    assert found.slopes is not None
    own, placed = captures.captures, tried[0].placed
    _, best = _most_hopeful(own, found, tried)
    x = float(best.x[-1])
    known = sorted({nothing, *(float(f.x[-1]) for f in tried)})
    below = max((k for k in known if k < x), default=x - (known[-1] - known[0]))
    above = min((k for k in known if k > x), default=x + (x - below))
    low, high = bounds(placed)
    between = [x + share * (end - x) for end in (below, above) for share in (1 / 3, 2 / 3)]
    more = [np.append(found.x, b) for b in between if low[-1] < b < high[-1]]
    every = [f for f in (*tried, *evaluate(captures, placed, more)) if f.residuals]
    _, best = _most_hopeful(own, found, every)
    other = min((f for f in every if f is not best), key=lambda f: abs(f.x[-1] - best.x[-1]), default=found)
    gap = float(best.x[-1] - (nothing if other is found else other.x[-1]))
    last = tuple(
        {name: (a[name] - b[name]) / gap for name in a} for a, b in zip(best.residuals, other.residuals, strict=True)
    )
    here = replace(best, slopes=(*found.slopes, last))
    _, moved = _expected(own, found, best)
    if np.any(moved != found.x):
        (start,) = evaluate(captures, placed, [np.append(moved, best.x[-1])])
        here = replace(start, slopes=here.slopes) if start.likelihood > best.likelihood else here
    return fit(captures, here)


def _most_hopeful(
    captures: Sequence[CaptureRecording], found: CaptureFit, tries: Sequence[CaptureFit]
) -> tuple[float, CaptureFit]:
    """The try that is expected to reach the most of L, after that."""
    return max(((_expected(captures, found, f)[0], f) for f in tries), key=lambda e: e[0])


def _expected(captures: Sequence[CaptureRecording], found: CaptureFit, there: CaptureFit) -> tuple[float, Array]:
    """L of a try once the parameters that were there move as their derivatives allow, and where they then stand."""
    if not np.isfinite(there.likelihood) or not len(found.x):
        return there.likelihood, found.x
    seen = replace(there, x=found.x, placed=found.placed, slopes=found.slopes)
    move, gain = step_from(captures, seen, FORESIGHT * steps(found.placed))
    return float(there.likelihood + gain), found.x + move


def _explained(captures: Sequence[CaptureRecording], found: CaptureFit, there: CaptureFit) -> float:
    """Share of the residual energy that is gone, each block by its own scale before."""
    if not there.residuals:
        return 0.0
    by = variances(captures, found.residuals)
    left = _energy(found.residuals, by)
    return 1 - _energy(there.residuals, by) / left if left else 0.0


def _energy(residuals: Sequence[Blocks], by: Mapping[str, float]) -> float:
    return float(sum(np.sum(r[name] ** 2) / by[name] for r in residuals for name in r))
