"""What a search found: names with their rivals, and the last search with its curves that no name explains."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...models.model import PlacedEffect
from ..evidence.search import MemberOdds, Search
from ..evidence.weighed import WeighedRecordings

Array = NDArray[np.float64]
F = TypeVar("F")
"""A fit of a kind of recording: a model with its values, and what the kind keeps beside them."""


@dataclass(frozen=True)
class RivalOdds:
    """A rival of an effect: its posterior share in the same place, and whether recordings can tell the two apart."""

    placed: PlacedEffect
    probability: float
    separable: bool


@dataclass(frozen=True)
class Naming:
    """An effect that the search named.

    ``gain`` is its log Bayes factor on the training recordings, ``share`` its posterior share among all possible
    replacements.
    """

    placed: PlacedEffect
    channels: tuple[int, ...]
    gain: float
    share: float
    rivals: tuple[RivalOdds, ...]


@dataclass(frozen=True)
class Remainder:
    """A nameless curve on a channel: its coordinates, its log Bayes factor, the share of the channel's residual that it
    explains [0 to 1], and the held-out recordings' gain by it in standard errors.
    """

    channel: int
    over: str
    gain: float
    explained: float
    held: float


@dataclass(frozen=True)
class Trial:
    """What one effect at one place explains by itself on top of a fit: share of the residual energy of its channels
    [0 to 1], and log posterior odds; ``smallest`` holds, by parameter, what would have been named."""

    placed: PlacedEffect
    explained: float
    odds: float
    smallest: Mapping[str, float]


@dataclass(frozen=True)
class Selection(Generic[F]):
    """The fit of the model as given, the fit with all names, and the recordings under these fits."""

    first: F
    last: F
    names: tuple[Naming, ...]
    trials: tuple[Trial, ...]
    """Before anything was found ..."""
    closing: tuple[Trial, ...]
    """... and beside all that was."""
    opening: WeighedRecordings
    """The recordings under the first fit ..."""
    weighed: WeighedRecordings
    """... and under that of the last search, ``searched``."""
    searched: F
    search: Search
    slots: tuple[MemberOdds, ...]
    """Of the last search."""
    tolerance: float

    @property
    def nameless(self) -> dict[tuple[int, str], float]:
        """Sizes of the nameless curves of the last search, by channel and words."""
        pool = self.weighed.pool
        return {pool[s.taken.hypothesis].label: s.taken.size for s in self.slots if not pool[s.taken.hypothesis].named}
