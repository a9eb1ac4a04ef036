"""Columns of one nuisance, and what they are made from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...evidence.pool import CandidateColumns, Curves
from ...evidence.weighed import Part
from ...fitting.fit import Fit
from ..hypotheses import ColumnSource

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NuisanceBlock:
    """Amplitudes of one nuisance that all recordings share.

    Parameters
    ----------
    count : int
        How many there are.
    parts : list of mappings from channel to (positions (p,), columns (n_band, p))
        Of each recording: which of the amplitudes a channel has, and their columns [N·m or N] in units of their prior
        deviation.
    tolerated : bool
        Whether they are the tolerance of the masses, whose size the evidence chooses.
    noise_beside : list of mappings from channel to columns (n_band, k)
        Of each recording, columns of any size beside which the noise is learnt, since they may be as large as what is
        missing; empty where they are not.
    """

    count: int
    parts: list[dict[int, Part]]
    tolerated: bool = False
    noise_beside: Sequence[Mapping[int, Array]] = ()


@dataclass(frozen=True)
class FitContext:
    """Recordings under a fit.

    Parameters
    ----------
    along : ColumnSource
        Instrument motions, with the model's state along each; the training recordings come first.
    found : Fit
    baseline : list of lists of (indices, columns)
        Of each recording and channel, the derivative by the fit's own parameters.
    by_words : mapping of (channel, words) to Item
        Nameless curves, in ``columns``.
    columns : CandidateColumns
    nameless : mapping of (channel, words) to float
        Sizes of those curves that a search ended with.
    """

    along: ColumnSource
    found: Fit
    baseline: Sequence[Sequence[Part]]
    by_words: Curves
    columns: CandidateColumns
    nameless: Mapping[tuple[int, str], float]

    @property
    def train(self) -> Sequence[Sequence[Part]]:
        """``baseline`` of the training recordings."""
        return self.baseline[: self.along.n_train]


def of_every(count: int, own: Mapping[int, Sequence[Array]]) -> NuisanceBlock:
    """A block of which every channel has all amplitudes; ``own``: by channel, columns (n_band, count) of all."""
    recordings = len(next(iter(own.values())))
    parts = [{c: (np.arange(count), x[i]) for c, x in own.items()} for i in range(recordings)]
    return NuisanceBlock(count, parts)
