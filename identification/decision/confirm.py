"""Confirm on the held-out recordings the names of a search, by the evidence of the search.

With an effect and without it the rest is fitted again, and both models predict the held-out recordings: the log density
of these given the training recordings (Dawid 1984), every nuisance integrated out anew. The nameless curves that the
search ended with stand beside both, so that a name which only imitates one of them shows no loss. A name stays if that
density falls without it by more than the scatter over blocks of time, and if the loss is larger than any model's own
error.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Generic

from ..deciding import DISCREPANCY, GATE
from ..evidence.forecast import Forecast
from ..evidence.gain import scatter
from .kind import RecordingKind
from .nearly import without_its_curves
from .selection import F, Naming, Selection


@dataclass(frozen=True)
class Loss(Generic[F]):
    """What the held-out recordings lose without an effect: log density and its scatter; the difference of the two
    models' predictions [RMS, share of the channel's, where it is largest], that channel; and the fit without it.
    """

    gain: float
    scatter: float
    size: float
    channel: int
    fit: F

    @property
    def sure(self) -> float:
        """The loss in units of its scatter."""
        return self.gain / max(self.scatter, 1e-12)

    @property
    def told(self) -> bool:
        """Whether the loss is beyond its scatter, and larger than any model's own error."""
        return self.sure > GATE and self.size >= DISCREPANCY


@dataclass(frozen=True)
class Confirmation(Generic[F]):
    """The names that the held-out recordings confirmed, the rejected ones, the loss of each, and the fit of the
    confirmed model.

    A name whose loss is beyond its scatter, but smaller than any model's own error, is neither."""

    found: Selection[F]
    names: tuple[Naming, ...]
    rejected: tuple[Naming, ...]
    weak: Mapping[str, Loss[F]]
    """What the held-out recordings miss of the rejected."""
    missed: Mapping[str, Loss[F]]
    last: F
    forecast: Forecast


def confirm(
    kind: RecordingKind[F], found: Selection[F], progress: Callable[[str], None] = lambda _: None
) -> Confirmation[F]:
    """Remove the name with the smallest held-out loss and fit all else again, until every name's loss is beyond its
    scatter.

    Names are removed one at a time: of two that replace each other, one stays, and its loss is larger from then on. So
    the others are tried again in the order of their last loss, and only until one is to be removed. Of a law and its
    special case, neither of which is missed, the law goes first (the principle of marginality: Nelder 1977).
    """
    progress("confirming on the held-out recordings")
    final = found.last
    whole = kind.forecast(found, final)
    left = {n.placed.key: n for n in found.names}
    missed: dict[str, Loss[F]] = {}
    rejected: list[Naming] = []
    weak: dict[str, Loss[F]] = {}
    stale = set(left)
    while stale:
        # What was never tried, then what was missed least.
        key = min(stale, key=lambda k: missed[k].sure if k in missed else float("-inf"))
        stale.remove(key)
        missed[key] = loss(kind, found, left[key], final, whole)
        if any(k not in missed for k in left):
            continue
        out = {k for k in left if not missed[k].told}
        special = {f"{part}.{left[k].placed.at}" for k in out for part in left[k].placed.effect.contains}
        weakest = min(left, key=lambda k: (k not in out, k in special, missed[k].sure))
        if not missed[weakest].told and weakest not in stale:
            removed, gone = left.pop(weakest), missed.pop(weakest)
            final = gone.fit
            if gone.sure <= GATE:
                rejected.append(removed)
                weak[weakest] = gone
            whole = kind.forecast(found, final)
            stale = set(left)
            progress(
                f"confirming on the held-out recordings: {removed.placed.key} is not confirmed, {len(left)} names left"
            )
    names = tuple(sorted(left.values(), key=lambda n: -missed[n.placed.key].size))
    return Confirmation(found, names, tuple(rejected), weak, missed, kind.known(found, final, whole), whole)


def loss(kind: RecordingKind[F], found: Selection[F], name: Naming, final: F, whole: Forecast) -> Loss[F]:
    """Take one effect out of a fit, and fit the rest again; ``whole`` is the forecast with it."""
    rest = kind.without(found, final, name.placed.key)
    beside = without_its_curves(kind, found, name.channels, final, rest)
    whole = whole if beside is found else kind.forecast(beside, final)
    other = kind.forecast_without(beside, name, final, rest)
    apart = kind.apart(final, rest)
    worst = max(name.channels, key=lambda c: apart[c])
    error = scatter(other.left, whole.left, [partial(kind.blocks, i) for i in kind.held])
    return Loss(whole.density - other.density, error, float(apart[worst]), worst, rest)
