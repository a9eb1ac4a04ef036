"""The evidence of hypotheses on some recordings, with the baseline and every nuisance integrated out.

    r = A b + C t + e,   b ~ N(0, 1),  t ~ N(0, κ² diag(spread²)),  e ~ N(0, K)

A has the columns that stand beside every hypothesis, in units of their priors: the baseline's parameters, the tolerance
of the masses, small curves. With S = K + A A' a hypothesis is H = C' S⁻¹ C and g = C' S⁻¹ r, and its log Bayes factor
against nothing is ½ g' (H + κ⁻²)⁻¹ g - ½ log det(1 + κ² H). Letters: n samples, m columns, P parameters beside.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..nuisance.covariance import Covariance
from .gain import Remaining
from .pool import CandidateColumns, Hypothesis, Item

Array = NDArray[np.float64]
Index = NDArray[np.int_]

ROWS = 256
"""Samples of all columns that are worked on together: all at once, they would take twice the memory of all of them."""


@dataclass(frozen=True)
class ResidualChannel:
    """One channel of one recording: residual (n,), its covariance, and the nuisance columns that stand beside every
    item: positions (p,) among all such parameters, and columns (n, p) in units of their prior deviation.
    """

    residual: Array
    covariance: Covariance
    index: Index
    columns: Array


@dataclass(frozen=True)
class Products:
    """What one channel of one recording says: A'K⁻¹A (p, p), A'K⁻¹r (p,), log det K, r'K⁻¹r, A'K⁻¹C (p, m), C'K⁻¹r
    (m,), p and m the channel's own; and C'K⁻¹C of the columns of each item, by their positions among C. Of other pairs
    few are wanted."""

    always: Array
    seen: Array
    log_det: float
    energy: float
    beside: Array
    score: Array
    each: Mapping[bytes, Array]


@dataclass(frozen=True)
class ItemStack:
    """Items of the same number of columns k, side by side: their numbers (N,), columns and spreads (N, k), signs."""

    numbers: Index
    index: Index
    spread: Array
    positive: NDArray[np.bool_]
    whole: bool


class Evidence:
    """Products of all columns over every recording; `ProjectedEvidence` sums some of them.

    Parameters
    ----------
    channels : sequence of sequences of ResidualChannel
        Of recording i and channel c.
    columns : CandidateColumns
    items : sequence of Item
        Every hypothesis at every shape.
    n_always : int
        How many parameters always stand beside.
    """

    def __init__(
        self,
        channels: Sequence[Sequence[ResidualChannel]],
        columns: CandidateColumns,
        items: Sequence[Item],
        n_always: int,
    ) -> None:
        """Work the products out, one channel after the other."""
        self.channels = [list(row) for row in channels]
        self.items, self.n_always, self.n_columns = tuple(items), n_always, columns.count
        self._pools = [[columns.of(i, c)[1] for c in range(len(row))] for i, row in enumerate(channels)]
        self.numbers = [columns.of(0, c)[0] for c in range(len(channels[0]))]
        self.where = [_inverse(x, columns.count) for x in self.numbers]
        self._made: dict[tuple[int, int], Products] = {}
        self._arrange()

    def _arrange(self) -> None:
        """Sort the items by their number of columns; nothing is known of their products yet."""
        by: dict[tuple[int, bool], list[int]] = {}
        for number, item in enumerate(self.items):
            by.setdefault((len(item.index), item.whole), []).append(number)
        self.alike: list[ItemStack] = []
        for (_, whole), numbers in by.items():
            rows = [self.items[x] for x in numbers]
            index, spread, positive = (
                np.stack(x) for x in zip(*((r.index, r.spread, r.positive) for r in rows), strict=True)
            )
            self.alike.append(ItemStack(np.array(numbers), index, spread, positive, whole))
        self._own: dict[tuple[int, int], list[tuple[Index, Array]]] = {}
        self._rows: dict[tuple[int, int, int], Array] = {}

    def products(self, i: int, c: int) -> Products:
        """Products of channel c of recording i, computed when first used: a search needs those of the training
        recordings only.
        """
        if (i, c) not in self._made:
            self._made[i, c] = self._products(i, c)
        return self._made[i, c]

    def _products(self, i: int, c: int) -> Products:
        own, pool = self.channels[i][c], self._pools[i][c]
        always, m = np.column_stack([own.residual, own.columns]), pool.shape[1]
        p = always.shape[1]
        beside, each = np.zeros((p, m)), self._each(c)
        if m:
            gram = np.zeros((p, p))
            blocks = (np.hstack([always[x], pool[x].astype(float)]) for x in _rows(len(always)))
            for white in own.covariance.white_by_rows(blocks):
                there = white[:, :p]
                gram += there.T @ there
                beside += there.T @ white[:, p:]
                columns = np.ascontiguousarray(white[:, p:].T)
                for at, total in each:
                    some = columns[at]
                    total += some @ some.transpose(0, 2, 1)
        else:  # few columns are divided sooner than made white
            gram = own.covariance.gram(always)
        known = {x.tobytes(): own for at, total in each for x, own in zip(at, total, strict=True)}
        return Products(
            gram[1:, 1:], gram[1:, 0], own.covariance.log_det, float(gram[0, 0]), beside[1:], beside[0], known
        )

    def _each(self, c: int) -> list[tuple[Index, Array]]:
        """Positions (N, k) on a channel of the columns of every item that reaches it, and room for their products."""
        found = []
        for group in self.alike:
            at = self.where[c][group.index]
            at = np.unique(at[at[:, 0] >= 0], axis=0)
            found.append((at, np.zeros((*at.shape, at.shape[1]))))
        return found

    def own(self, i: int, c: int) -> list[tuple[Index, Array]]:
        """For each of `alike`, on channel c of recording i: which items have columns there, and C'K⁻¹C (., k, k)."""
        if (i, c) not in self._own:
            each, found = self.products(i, c).each, []
            for group in self.alike:
                at = self.where[c][group.index]
                rows = np.flatnonzero(at[:, 0] >= 0)
                k = at.shape[1]
                found.append((rows, np.array([each[x.tobytes()] for x in at[rows]]).reshape(len(rows), k, k)))
            self._own[i, c] = found
        return self._own[i, c]

    def row(self, i: int, c: int, number: int) -> Array:
        """C_item'K⁻¹C of an item with every column of channel c of recording i (k, m)."""
        key = (i, c, number)
        if key not in self._rows:
            pool, at = self._pools[i][c], self.where[c][self.items[number].index]
            divided = self.channels[i][c].covariance.solve(pool[:, at].astype(float)).T
            self._rows[key] = total = np.zeros((len(at), pool.shape[1]))
            for x in _rows(len(pool)):
                total += divided[:, x] @ pool[x].astype(float)
        return self._rows[key]

    def with_covariances(self, c: int, covariances: Sequence[Covariance]) -> "Evidence":
        """This evidence with other covariances of one channel, one a recording."""
        other = copy(self)
        other.channels = [list(row) for row in self.channels]
        other._forget(c)
        for i, covariance in enumerate(covariances):
            other.channels[i][c] = replace(self.channels[i][c], covariance=covariance)
        return other

    def _forget(self, c: int) -> None:
        """Forget, on a copy, what depends on the covariance of a channel."""
        self._made = {key: x for key, x in self._made.items() if key[1] != c}
        self._own = {key: x for key, x in self._own.items() if key[1] != c}
        self._rows = {key: x for key, x in self._rows.items() if key[1] != c}

    def alone(self, c: int, pool: Sequence[Hypothesis]) -> "tuple[Evidence, list[Hypothesis], Index]":
        """One channel by itself: its evidence, the hypotheses that reach it, and which always stand beside it.

        If a hypothesis reaches a channel at some of its shapes only, these shapes remain."""
        always = np.unique(np.concatenate([row[c].index for row in self.channels]))
        at = self.where[c]
        reach = [tuple(replace(x, index=at[x.index]) for x in h.items if at[x.index[0]] >= 0) for h in pool]
        own = [replace(h, items=items) for h, items in zip(pool, reach, strict=True) if items]
        other = copy(self)
        other.channels = [[replace(row[c], index=np.searchsorted(always, row[c].index))] for row in self.channels]
        other.items = tuple(x for h in own for x in h.items)
        other.n_always, other.n_columns = len(always), len(self.numbers[c])
        other._pools = [[row[c]] for row in self._pools]
        other.numbers = [np.arange(other.n_columns)]
        other.where = [np.arange(other.n_columns)]
        other._made = {(i, 0): x for (i, k), x in self._made.items() if k == c}
        other._arrange()
        return other, own, always

    def of_items(self, numbers: Sequence[int]) -> "Evidence":
        """The evidence of some items by themselves, without the columns of the others."""
        columns = np.unique(np.concatenate([self.items[x].index for x in numbers]))
        other = copy(self)
        other.items = tuple(
            replace(self.items[x], index=np.searchsorted(columns, self.items[x].index)) for x in numbers
        )
        there = [x[columns] >= 0 for x in self.where]
        at = [x[columns[own]] for x, own in zip(self.where, there, strict=True)]
        other._pools = [[pool[:, x] for pool, x in zip(row, at, strict=True)] for row in self._pools]
        other.numbers = [np.flatnonzero(own) for own in there]
        other.n_columns = len(columns)
        other.where = [_inverse(x, other.n_columns) for x in other.numbers]
        other._made = {}
        other._arrange()
        return other

    def with_channel(self, c: int, alone: "Evidence") -> "Evidence":
        """This evidence with one channel's covariance and products taken from ``alone``."""
        other = copy(self)
        other.channels = [list(row) for row in self.channels]
        other._forget(c)
        for i, row in enumerate(alone.channels):
            other.channels[i][c] = replace(self.channels[i][c], covariance=row[0].covariance)
        other._made |= {(i, c): x for (i, _), x in alone._made.items()}
        return other

    def energy(self, i: int, c: int) -> float:
        """r' K⁻¹ r of a channel of a recording."""
        return self.products(i, c).energy

    def reached(self, item: Item) -> list[int]:
        """Channels that an item has columns on."""
        return [c for c, at in enumerate(self.where) if at[item.index[0]] >= 0]

    def contribution(self, i: int, c: int, item: Item, amplitudes: Array) -> Array:
        """What an item adds to a channel of a recording (n,) at amplitudes in units of its spread."""
        here = self.where[c][item.index]
        if here[0] < 0:
            return np.zeros(len(self.channels[i][c].residual))
        return self._pools[i][c][:, here] @ (item.spread * amplitudes)

    def left(self, i: int, always: Array, members: Sequence[tuple[Item, Array]]) -> Remaining:
        """What the nuisances and members leave of a recording at these amplitudes."""
        residuals = []
        for c, own in enumerate(self.channels[i]):
            e = own.residual - own.columns @ always[own.index]
            for item, amplitudes in members:
                e = e - self.contribution(i, c, item, amplitudes)
            residuals.append(e)
        return Remaining.of(residuals, [own.covariance for own in self.channels[i]])


def _rows(n: int) -> Iterator[slice]:
    """Runs of `ROWS` of n samples."""
    return (slice(k, k + ROWS) for k in range(0, n, ROWS))


def _inverse(numbers: Index, count: int) -> Index:
    at = np.full(count, -1)
    at[numbers] = np.arange(len(numbers))
    return at
