"""Hypotheses and their columns: what each would add to each channel of each recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]

ROOM = 2048
"""Columns that a channel of a recording has room for at first: more than most have, as a copy leaves a hole behind."""


@dataclass(frozen=True)
class Item:
    """A hypothesis with its shape set: columns of the pool, and the prior of their amplitudes.

    ``spread`` (k,) is the prior standard deviation of each amplitude for an effect of relative size one; ``positive``
    (k,) marks amplitudes that cannot be negative. ``whole``: the one column is the whole law, with an amplitude of one.
    ``label`` is for the caller. ``prior``: log of its prior odds to an item of an even share of the hypothesis's, where
    an item stands for more, or fewer, points of a grid than it is itself.
    """

    index: NDArray[np.int_]
    spread: Array
    positive: NDArray[np.bool_]
    whole: bool = False
    label: Any = None
    prior: float = 0.0


@dataclass(frozen=True)
class Hypothesis:
    """An explanation with all its shapes, and its prior log odds. ``key`` names it; ``named``: it is in the
    vocabulary; ``kind`` is the same for all places of an effect, and ``more`` holds its prior log odds where one, two
    and more of its kind are in the set already. ``apart`` holds the keys of those that write the same curve: no set has
    them beside it."""

    key: str
    named: bool
    items: tuple[Item, ...]
    prior: float
    label: Any = None
    kind: str = ""
    more: tuple[float, ...] = ()
    apart: frozenset[str] = frozenset()

    def prior_beside(self, others: int) -> float:
        """Prior log odds beside this number of others of its kind."""
        return (self.prior, *self.more)[min(others, len(self.more))]


Curves = Mapping[tuple[int, str], Item]
"""Nameless curves by channel and words."""


@dataclass
class CandidateColumns:
    """Columns of all hypotheses, by recording and channel, numbered through.

    They are stored in single precision, 6e-8 of each value, since they take most of a diagnosis's memory; products are
    computed in double precision.
    """

    lengths: Sequence[int]
    """Samples of each recording in the analysis band."""
    count: int = 0
    numbers: dict[int, list[NDArray[np.int_]]] = field(default_factory=dict)
    filled: dict[int, int] = field(default_factory=dict)
    """How many columns a channel has."""
    rows: dict[tuple[int, int], Single] = field(default_factory=dict)
    """One a column; with room for more, which takes no memory before it is written to."""

    def add(self, own: Mapping[int, Sequence[Array]]) -> NDArray[np.int_]:
        """Enter columns: for each channel one array (n, k) a recording, of the same k everywhere; their numbers."""
        k = next(iter(own.values()))[0].shape[1]
        index = np.arange(self.count, self.count + k)
        self.count += k
        for c, parts in own.items():
            before = self.filled.get(c, 0)
            self.filled[c] = before + k
            self.numbers.setdefault(c, []).append(index)
            for i, x in enumerate(parts):
                rows = self.rows.get((i, c), np.empty((0, self.lengths[i]), np.float32))
                if before + k > len(rows):
                    more = np.empty((max(2 * len(rows), before + k, ROOM), self.lengths[i]), np.float32)
                    more[:before] = rows[:before]
                    self.rows[i, c] = rows = more
                rows[before : before + k] = x.T
        return index

    def of(self, recording: int, channel: int) -> tuple[NDArray[np.int_], Single]:
        """Numbers (m,) and columns (n, m) of a channel."""
        if channel not in self.numbers:
            return np.zeros(0, int), np.zeros((0, 0), np.float32)
        numbers = np.concatenate(self.numbers[channel])
        return numbers, self.rows[recording, channel][: len(numbers)].T

    def has(self, channel: int, number: int) -> bool:
        """Whether a column belongs to a channel."""
        return any(index[0] <= number <= index[-1] for index in self.numbers.get(channel, ()))

    def some(self, recording: int, channel: int, wanted: NDArray[np.int_]) -> Array:
        """Columns of a channel (n, k) by their numbers."""
        if not len(wanted):
            return np.zeros((self.lengths[recording], 0))
        numbers, columns = self.of(recording, channel)
        return columns[:, np.searchsorted(numbers, wanted)].astype(float, order="C")
