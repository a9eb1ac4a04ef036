"""Hypotheses and their columns: what each would add to each channel of each recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]


@dataclass(frozen=True)
class Item:
    """A hypothesis with its shape set: columns of the pool, and the prior of their amplitudes.

    ``spread`` (k,) is the prior standard deviation of each amplitude for an effect of relative size one; ``positive``
    (k,) marks amplitudes that cannot be negative. ``whole``: the one column is the whole law, with an amplitude of one.
    ``label`` is for the caller.
    """

    index: NDArray[np.int_]
    spread: Array
    positive: NDArray[np.bool_]
    whole: bool = False
    label: Any = None


@dataclass(frozen=True)
class Hypothesis:
    """An explanation with all its shapes, and its prior log odds. ``key`` names it; ``named``: it is in the
    vocabulary; ``kind`` is the same for all places of an effect, and ``more`` holds its prior log odds where one, two
    and more of its kind are in the set already."""

    key: str
    named: bool
    items: tuple[Item, ...]
    prior: float
    label: Any = None
    kind: str = ""
    more: tuple[float, ...] = ()

    def prior_beside(self, others: int) -> float:
        """Prior log odds beside this number of others of its kind."""
        return (self.prior, *self.more)[min(others, len(self.more))]


@dataclass
class CandidateColumns:
    """Columns of all hypotheses, by recording and channel, numbered through.

    They are stored in single precision, 6e-8 of each value, since they take most of a diagnosis's memory; products are
    computed in double precision.
    """

    lengths: Sequence[int]
    """Samples of each recording in the analysis band."""
    count: int = 0
    parts: dict[tuple[int, int], list[Single]] = field(default_factory=dict)
    numbers: dict[int, list[NDArray[np.int_]]] = field(default_factory=dict)
    stacked: dict[tuple[int, int], Single] = field(default_factory=dict)
    """Once asked for, side by side; ``parts`` are views of them."""

    def add(self, own: Mapping[int, Sequence[Array]]) -> NDArray[np.int_]:
        """Enter columns: for each channel one array (n, k) a recording, of the same k everywhere; their numbers."""
        k = next(iter(own.values()))[0].shape[1]
        index = np.arange(self.count, self.count + k)
        self.count += k
        for c, parts in own.items():
            self.numbers.setdefault(c, []).append(index)
            for i, x in enumerate(parts):
                self.parts.setdefault((i, c), []).append(x.astype(np.float32))
        return index

    def of(self, recording: int, channel: int) -> tuple[NDArray[np.int_], Single]:
        """Numbers (m,) and columns (n, m) of a channel."""
        if channel not in self.numbers:
            return np.zeros(0, int), np.zeros((0, 0), np.float32)
        key, numbers = (recording, channel), np.concatenate(self.numbers[channel])
        if key not in self.stacked or self.stacked[key].shape[1] < len(numbers):
            whole = self.stacked[key] = np.concatenate(self.parts[key], axis=1)
            edges = np.cumsum([0, *(x.shape[1] for x in self.parts[key])])
            self.parts[key] = [whole[:, a:b] for a, b in pairwise(edges)]
        return numbers, self.stacked[key]

    def has(self, channel: int, number: int) -> bool:
        """Whether a column belongs to a channel."""
        return any(index[0] <= number <= index[-1] for index in self.numbers.get(channel, ()))

    def some(self, recording: int, channel: int, wanted: NDArray[np.int_]) -> Array:
        """Columns of a channel (n, k) by their numbers."""
        own = []
        for index, x in zip(self.numbers.get(channel, ()), self.parts.get((recording, channel), ()), strict=True):
            inside = wanted[(wanted >= index[0]) & (wanted <= index[-1])]
            if len(inside):
                own.append((inside, x[:, inside - index[0]]))
        if not own:
            return np.zeros((self.lengths[recording], 0))
        numbers = np.concatenate([a for a, _ in own])
        order = {int(a): k for k, a in enumerate(numbers)}
        return np.concatenate([x for _, x in own], axis=1)[:, [order[int(w)] for w in wanted]].astype(float)
