"""One interface for a kind of recording, as a decision sees it.

A kind fits models to its training recordings, and gives the evidence of every hypothesis beside a fit; what is
searched, confirmed and told is decided alike for all of them. Arms, fixed, floating and suspended, are one kind
(`arms.kind`); link encoders, captures, docking tests and commanded servos, whose models are simulated, another
(`sources.kind`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..evidence.forecast import Forecast
from ..evidence.projected import ProjectedEvidence
from ..evidence.search import MemberOdds, Search
from ..evidence.weighed import WeighedRecordings
from ..nuisance.bursts import Bursts
from .selection import F, Naming, Selection

Array = NDArray[np.float64]
Chosen = tuple[MemberOdds, Sequence[MemberOdds]]
"""A name to take, and the set beside which its amplitudes are."""


class RecordingKind(Protocol[F]):
    """Recordings of one kind: the training recordings first, then the held-out ones."""

    @property
    def train(self) -> range:
        """Numbers of the training recordings."""
        ...

    @property
    def held(self) -> range:
        """Numbers of the held-out recordings."""
        ...

    def first(self, progress: Callable[[str], None]) -> F:
        """The fit of the model as given."""
        ...

    def fitted(self, before: F, placed: Sequence[PlacedEffect], values: Mapping[str, float],
               weighed: WeighedRecordings) -> F:  # fmt: skip
        """The fit with more effects, from where they start."""
        ...

    def closed(self, last: F, weighed: WeighedRecordings) -> F:
        """The fit of a search that named nothing."""
        ...

    def without(self, found: Selection[F], fit: F, key: str) -> F:
        """The fit without an effect, all else fitted again."""
        ...

    def known(self, found: Selection[F], fit: F, whole: Forecast) -> F:
        """The fit with the deviations that the evidence gives its values."""
        ...

    def residuals(self, fit: F) -> Sequence[Array]:
        """Of each training recording (n, J)."""
        ...

    def weighed(self, fit: F, known: WeighedRecordings | None, *, anew: bool = False) -> WeighedRecordings:
        """The recordings under a fit with every hypothesis; in ``known`` noise, unless the kind learns it ``anew``
        where the model has more effects."""
        ...

    def chosen(self, made: Search, slots: Sequence[MemberOdds], large: Sequence[MemberOdds]) -> list[Chosen]:
        """Which of the ``large`` names of a best set to fit before the next search."""
        ...

    def started(self, fit: F, made: Search, slot: MemberOdds, amplitudes: Array) -> tuple[PlacedEffect,
                                                                                        dict[str, float]]:  # fmt: skip
        """The effect of a slot, and where its parameters start."""
        ...

    def smallest(self, made: Search, hypothesis: int) -> Mapping[str, float]:
        """By parameter of an effect, what would have been named, had it been there."""
        ...

    def forecast(self, found: Selection[F], fit: F) -> Forecast:
        """The held-out recordings as a fit predicts them, every nuisance integrated out, in the noise of a search."""
        ...

    def forecast_without(self, found: Selection[F], name: Naming, fit: F, rest: F) -> Forecast:
        """As `forecast`, by the ``rest`` of a fit without a name."""
        ...

    def apart(self, one: F, other: F) -> Array:
        """RMS difference of two fits' predictions of the held-out recordings [share of the channel's RMS] (J,)."""
        ...

    def with_held(self, found: Selection[F], fit: F,
                  items: Sequence[int]) -> tuple[ProjectedEvidence, dict[int, int]]:  # fmt: skip
        """The evidence of some items of a search on all recordings, and their numbers in it; what cannot be predicted
        there is left out."""
        ...

    def blocks(self, i: int, x: Array) -> Array:
        """Sums over blocks of time."""
        ...

    def bursts(self, found: Selection[F]) -> Mapping[int, Bursts]:
        """Of every channel, what comes and goes in the residual that a search leaves."""
        ...
