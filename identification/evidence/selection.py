"""What a search found: names with their rivals, and curves that no name explains."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.model import Model, PlacedEffect
from ..fitting.experiment import Experiment
from ..fitting.fit import Fit
from .arm import WeighedRecordings
from .rival import RivalOdds
from .search import MemberOdds, Search

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArmNaming:
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
class ArmTrial:
    """What one effect at one place explains by itself on top of the baseline: share of the residual energy of its
    channels [0 to 1], and log posterior odds; ``smallest`` holds, by parameter, what would have been named."""

    placed: PlacedEffect
    explained: float
    odds: float
    smallest: Mapping[str, float]


@dataclass(frozen=True)
class ArmSelection:
    """The baseline's fit, the model with all names and its fit, and the recordings under these fits."""

    first: Fit
    model: Model
    fit: Fit
    names: tuple[ArmNaming, ...]
    trials: tuple[ArmTrial, ...]
    """Before anything was found ..."""
    closing: tuple[ArmTrial, ...]
    """... and beside all that was."""
    opening: WeighedRecordings
    """The recordings under the first fit ..."""
    weighed: WeighedRecordings
    """... and under the last."""
    slots: tuple[MemberOdds, ...]
    """Of the last search."""
    search: Search
    instruments: tuple[Experiment, ...]
    tolerance: float
    tuned: Mapping[str, Array]
    """Parameters of every law that rings, by its key, fitted by itself."""

    @property
    def nameless(self) -> dict[tuple[int, str], float]:
        """Sizes of the nameless curves of the last search, by channel and words."""
        pool = self.weighed.pool
        return {
            (pool[s.taken.hypothesis].label[0], pool[s.taken.hypothesis].label[1].words): s.taken.size
            for s in self.slots
            if not pool[s.taken.hypothesis].named
        }
