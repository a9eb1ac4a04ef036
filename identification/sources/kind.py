"""Recordings of any `Source` as a decision sees them."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..decision.kind import Chosen
from ..decision.selection import Naming, Selection
from ..evidence.forecast import Forecast
from ..evidence.forecast import forecast as predicted
from ..evidence.pool import Item
from ..evidence.projected import ProjectedEvidence
from ..evidence.search import MemberOdds, Search
from ..evidence.weighed import WeighedRecordings
from ..nuisance.bursts import Bursts
from ..nuisance.noise import NoiseChannel
from .choice import one_a_channel
from .fit import fit as fitted_from
from .fit import kept_columns, linearised
from .own import refitted
from .smallest import smallest
from .source import GridPoint, Linearisation, ModelPoint, Source
from .weigh import PointKey, covariances, opened, point_key, weigh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SourceFit:
    """A model fitted to the training recordings, and the held-out ones linearised about it.

    Parameters
    ----------
    source : Source
    train : Linearisation
    shifted : list of array (n, c, S), or None
        The shifts' columns of the training recordings, where all fits keep those of the first.
    like : SourceFit, optional
        One whose shifts' columns of the held-out recordings this fit keeps.
    """

    source: Source
    train: Linearisation
    shifted: Sequence[Array] | None
    like: "SourceFit | None" = None

    @cached_property
    def held(self) -> Linearisation:
        """The held-out recordings, computed when first asked for."""
        known = None if self.like is None else kept_columns(self.source, self.like.held)
        numbers = self.source.held
        return linearised(self.source, numbers, self.source.settled(self.train.at, numbers), known)

    @cached_property
    def runs(self) -> list[list[NoiseChannel]]:
        """What the noise of the held-out recordings depends on."""
        could = [[x[:, c] for x in self.held.columns] for c in range(len(self.source.channels))]
        return self.source.noise_channels(self.source.held, self.held, could)


@dataclass(frozen=True, eq=False)
class SourceRecordings:
    """Recordings of a source, and the model as ``given``."""

    source: Source
    given: ModelPoint

    @property
    def train(self) -> range:
        """Numbers of the training recordings."""
        return self.source.train

    @property
    def held(self) -> range:
        """Numbers of the held-out recordings."""
        return self.source.held

    def first(self, progress: Callable[[str], None]) -> SourceFit:
        """The model as given, which is not fitted before it is searched: what it lacks is not to bend it."""
        progress(f"comparing {len(self.train)} recordings with the model as given")
        here = linearised(self.source, self.train, self.source.settled(self.given, self.train))
        return SourceFit(self.source, here, kept_columns(self.source, here))

    def fitted(
        self, before: SourceFit, placed: Sequence[PlacedEffect], values: Mapping[str, float], weighed: WeighedRecordings
    ) -> SourceFit:
        """The fit with more effects."""
        start = before.train.at.with_effects(placed, values)
        _, here = refitted(self.source, self.given, start, weighed, before.shifted)
        return SourceFit(self.source, here, before.shifted)

    def closed(self, last: SourceFit, weighed: WeighedRecordings) -> SourceFit:
        """The parameters of the model as given, fitted."""
        here = fitted_from(self.source, self.given, last.train.at, covariances(weighed), last.shifted)
        return SourceFit(self.source, here, last.shifted)

    def without(self, found: Selection[SourceFit], fit: SourceFit, key: str) -> SourceFit:
        """The fit without an effect."""
        noise, kept = covariances(found.weighed), kept_columns(self.source, found.last.train)
        rest = fitted_from(self.source, self.given, fit.train.at.without(key), noise, kept)
        return SourceFit(self.source, rest, fit.shifted, found.last)

    def known(self, found: Selection[SourceFit], fit: SourceFit, whole: Forecast) -> SourceFit:
        """The fit: deviations are worked out for the answer (`fit.deviations`)."""
        return fit

    def residuals(self, fit: SourceFit) -> Sequence[Array]:
        """Of each training recording (n, c)."""
        return fit.train.residuals

    def weighed(self, fit: SourceFit, known: WeighedRecordings | None, *, anew: bool = False) -> WeighedRecordings:
        """The training recordings with every hypothesis: of the held-out ones only what is chosen is worked out.

        Far from the truth a misfit is taken for noise: so it is learnt anew."""
        return opened(self.source, self.given, fit.train, None if anew else known)

    def chosen(self, made: Search, slots: Sequence[MemberOdds], large: Sequence[MemberOdds]) -> list[Chosen]:
        """One name at a time on every channel."""
        return one_a_channel(made, large)

    def started(
        self, fit: SourceFit, made: Search, slot: MemberOdds, amplitudes: Array
    ) -> tuple[PlacedEffect, dict[str, float]]:
        """An effect that was taken, and the values that its parameters start from."""
        item = made.on.evidence.items[slot.taken.item]
        variant: GridPoint = item.label
        values = dict(variant.values)
        bounds = {f"{variant.placed.key}.{x.name}": (x.low, x.high) for x in variant.placed.effect.parameters}
        for key, value in zip(variant.amplitudes, item.spread * amplitudes, strict=False):
            values[key] = float(np.clip(variant.origin.get(key, 0.0) + value, *bounds[key]))
        return variant.placed, values

    def smallest(self, made: Search, hypothesis: int) -> dict[str, float]:
        """By parameter of an effect, what would have been named."""
        return smallest(made, hypothesis)

    def forecast(self, found: Selection[SourceFit], fit: SourceFit) -> Forecast:
        """The held-out recordings as a fit predicts them."""
        return self._forecast(found, fit)

    def forecast_without(self, found: Selection[SourceFit], name: Naming, fit: SourceFit, rest: SourceFit) -> Forecast:
        """As the rest of a fit does."""
        return self._forecast(found, rest, self.source.own_shifts(name.placed))

    def _forecast(
        self, found: Selection[SourceFit], fit: SourceFit, tolerance_of_name: Collection[int] = ()
    ) -> Forecast:
        """Without a name, the shifts that are its own tolerance are known to their deviations alone, and not from the
        training recordings: learnt there they would be the effect itself under another name, however many deviations
        it takes.
        """
        both_sets = [*self.train, *self.held]
        weighed = weigh(
            self.source, both_sets, self.given, _joined(fit), self._noise(found), search=False, nameless=found.nameless
        )
        p = len(fit.train.at.values)
        return predicted(weighed, self.train, self.held, p, untold=[p + s for s in tolerance_of_name])

    def apart(self, one: SourceFit, other: SourceFit) -> Array:
        """RMS difference of two fits' predictions, with the set-up as it is stated [share of the channel's RMS] (c,).

        With shifts as fitted, one that stands in for an effect would leave no difference."""
        pairs = zip(_as_stated(one.held), _as_stated(other.held), strict=True)
        return np.sqrt(np.mean(np.concatenate([a - b for a, b in pairs]) ** 2, axis=0)) / self.source.scale()

    def with_held(
        self, found: Selection[SourceFit], fit: SourceFit, items: Sequence[int]
    ) -> tuple[ProjectedEvidence, dict[int, int]]:
        """The evidence of some items on all recordings."""
        every = found.search.on.evidence.items
        wanted = [every[x] for x in items]
        points = [x for x in wanted if isinstance(x.label, GridPoint)]
        only = {point_key(x.label) for x in points}
        alone = {x.label.placed.key: x.label for x in points if not (x.whole or x.label.amplitudes)}
        numbers = [*self.train, *self.held]
        noise = self._noise(found)
        weighed = weigh(self.source, numbers, self.given, _joined(fit), noise, search=True, alone=alone, only=only)
        both = ProjectedEvidence(weighed.evidence, range(len(numbers)), weighed.beside.weight(found.tolerance))
        there = {_told(x): k for k, x in enumerate(weighed.evidence.items)}
        return both, {x: there[_told(every[x])] for x in items if _told(every[x]) in there}

    def _noise(self, found: Selection[SourceFit]) -> WeighedRecordings:
        """The noise of a search, for all recordings."""
        return replace(found.weighed, runs=[*found.weighed.runs[: len(self.train)], *found.last.runs])

    def blocks(self, i: int, x: Array) -> Array:
        """Sums over blocks of time."""
        return self.source.blocks(i, x)

    def bursts(self, found: Selection[SourceFit]) -> dict[int, Bursts]:
        """None: too short, or too few, for what comes and goes."""
        return {}


def _as_stated(there: Linearisation) -> list[Array]:
    """Residuals (n, c) of recordings whose set-up is as it is stated."""
    p = len(there.at.values)
    pairs = zip(there.residuals, there.columns, strict=True)
    return [r + x[:, :, p:] @ there.at.shifts for r, x in pairs]


def _joined(fit: SourceFit) -> Linearisation:
    # What is the held-out recordings' own stands there alone.
    here, there = fit.train, fit.held
    return Linearisation(there.at, (*here.residuals, *there.residuals), (*here.columns, *there.columns))


def _told(item: Item) -> tuple[PointKey | tuple[int, str], int]:
    """What tells an item from every other: an effect's point or a curve, and how many columns it has there."""
    return point_key(item.label) if isinstance(item.label, GridPoint) else item.label, len(item.index)
