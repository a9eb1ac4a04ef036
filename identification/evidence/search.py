"""One search over sets of explanations: forward, backward and exchange moves until none raises the posterior.

A set's log posterior has three terms: the log Bayes factor of its members together, at their best shapes and sizes; its
prior log odds; and for each member the (negative) effect of averaging over shapes and sizes, when it was added. Names
and nameless curves are treated alike.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from .members import SIZES, Members
from .pool import Hypothesis
from .projected import ProjectedEvidence

Array = NDArray[np.float64]

MOST = 12
"""Members of a set at most."""

EXCHANGED = 3
"""Best replacements of each member that are tried."""

MOVED = 0.05
"""Log posterior by which a move must raise a set's."""


@dataclass(frozen=True)
class Member:
    """A hypothesis in a set: the number of its item, its size, and the (negative) effect of averaging."""

    hypothesis: int
    item: int
    size: float
    offset: float


@dataclass(frozen=True)
class Scan:
    """Every hypothesis on top of a set: log posterior odds, the best item and size, the log Bayes factor there."""

    odds: Array
    item: NDArray[np.int_]
    size: Array
    gain: Array


@dataclass(frozen=True)
class MemberOdds:
    """A member of the best set and its possible replacements: log odds (N,) and their shares; the last share is that of
    no replacement.
    """

    taken: Member
    gain: float
    odds: Array
    shares: Array


class Search:
    """The search for the best set of hypotheses on some recordings."""

    def __init__(self, on: ProjectedEvidence, pool: Sequence[Hypothesis], barred: Collection[int] = ()) -> None:
        """``barred``: hypotheses that no set may have. Items stand in the evidence in the order of the pool."""
        self.on, self.pool, self.barred = on, pool, set(barred)
        counts = np.array([len(h.items) for h in pool], int)
        self._starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)
        self._counts = counts
        self._item_priors = np.array([x.prior for h in pool for x in h.items])
        self._scans: dict[frozenset[tuple[int, float]], Scan] = {}
        self._sets: dict[frozenset[tuple[int, float]], Members] = {}

    def members(self, taken: Sequence[Member]) -> Members:
        """The members of a set, computed once."""
        key = _key(taken)
        if key not in self._sets:
            self._sets[key] = Members(self.on, [(t.item, t.size) for t in taken])
        return self._sets[key]

    def scan(self, taken: Sequence[Member]) -> Scan:
        """Every hypothesis on top of a set."""
        key = _key(taken)
        if key not in self._scans:
            gains = self.members(taken).gains()
            likely = gains + self._item_priors[:, None]
            best = likely.max(axis=1)
            pairs = zip(self._starts, self._counts, strict=True)
            item = np.array([start + int(np.argmax(best[start : start + n])) for start, n in pairs])
            highest = best[item]
            weight = np.exp(likely - np.repeat(highest, self._counts)[:, None])
            cases = np.add.reduceat(np.isfinite(gains).sum(axis=1), self._starts)
            mean = np.log(np.add.reduceat(weight.sum(axis=1), self._starts) / cases) + highest
            size = np.argmax(gains[item], axis=1)
            self._scans[key] = Scan(mean + self._prior(taken), item, SIZES[size], gains[item, size])
        return self._scans[key]

    def total(self, taken: Sequence[Member]) -> float:
        """Log posterior of a set against nothing."""
        return self.members(taken).value + self._log_prior(taken) + sum(t.offset for t in taken)

    def _prior(self, taken: Sequence[Member]) -> Array:
        """Log odds (N,) of every hypothesis beside a set, before the recordings are looked at."""
        own = [self.pool[t.hypothesis].kind for t in taken]
        return np.array([h.prior_beside(own.count(h.kind)) for h in self.pool])

    def _log_prior(self, taken: Sequence[Member]) -> float:
        """Log odds of a set, before the recordings are looked at."""
        own = [self.pool[t.hypothesis] for t in taken]
        return sum(h.prior_beside(sum(x.kind == h.kind for x in own[:k])) for k, h in enumerate(own))

    def run(self, start: Sequence[Member] = (), *, exchange: bool = True) -> tuple[float, list[Member]]:
        """The best set that moves from a start reach, and its log posterior.

        Members are added, and dropped, until neither helps; only then is each tried against what could replace it.
        """
        taken = list(start)
        best = self.total(taken)
        while True:
            moves = [[*taken, t] for t in self._best(taken, 1) if self.scan(taken).odds[t.hypothesis] > 0]
            moves = moves if len(taken) < MOST else []
            moves += [taken[:k] + taken[k + 1 :] for k in range(len(taken))]
            value, move = self._highest(moves)
            if value <= best + MOVED and exchange:
                rests = [(t, taken[:k] + taken[k + 1 :]) for k, t in enumerate(taken)]
                value, move = self._highest(
                    [[*rest, x] for t, rest in rests for x in self._best(rest, EXCHANGED) if x.item != t.item]
                )
            if value <= best + MOVED:
                return best, taken
            best, taken = value, move

    def _highest(self, moves: Sequence[list[Member]]) -> tuple[float, list[Member]]:
        """The move to the best set."""
        return max(((self.total(m), m) for m in moves), key=lambda pair: pair[0], default=(-np.inf, []))

    def _best(self, taken: Sequence[Member], count: int) -> list[Member]:
        """The hypotheses with the highest odds on top of a set, which does not have them."""
        odds = self.scan(taken).odds.copy()
        odds[self._out(taken)] = -np.inf
        return [self.take(taken, int(h)) for h in np.argsort(-odds)[:count] if np.isfinite(odds[h])]

    def _out(self, taken: Sequence[Member]) -> list[int]:
        """What cannot join a set: its members, what writes the same curve as one of them, and what is barred."""
        own = [t.hypothesis for t in taken]
        apart = frozenset().union(*(self.pool[h].apart for h in own))
        return sorted({*own, *self.barred, *(h for h, x in enumerate(self.pool) if x.key in apart)})

    def take(self, taken: Sequence[Member], h: int) -> Member:
        """A hypothesis at its best on top of a set."""
        rows = self.scan(taken)
        plain = Member(h, int(rows.item[h]), float(rows.size[h]), 0.0)
        gained = self.members([*taken, plain]).value - self.members(taken).value
        prior = self.pool[h].prior_beside(sum(self.pool[t.hypothesis].kind == self.pool[h].kind for t in taken))
        return replace(plain, offset=float(rows.odds[h]) - prior - gained)

    def answer(self) -> list[MemberOdds]:
        """The best set from two starts, nothing and the best nameless curve, and the rivals of each member."""
        if not self.pool:
            return []
        found = [self.run()]
        odds = self.scan([]).odds
        curves = [h for h, x in enumerate(self.pool) if not x.named and h not in self.barred]
        top = max(curves, key=lambda h: odds[h], default=None)
        if top is not None and odds[top] > 0 and found[0][1]:
            found.append(self.run([self.take([], top)]))
        _, taken = max(found, key=lambda pair: pair[0])
        return [self.slot(taken, k) for k in range(len(taken))]

    def slot(self, taken: Sequence[Member], k: int) -> MemberOdds:
        """A member of a set and its possible replacements."""
        taken = list(taken)
        rest = taken[:k] + taken[k + 1 :]
        rows = self.scan(rest)
        odds = rows.odds.copy()
        odds[self._out(rest)] = -np.inf
        both = np.append(odds, 0.0)
        return MemberOdds(taken[k], float(rows.gain[taken[k].hypothesis]), odds, np.exp(both - logsumexp(both)))


def _key(taken: Sequence[Member]) -> frozenset[tuple[int, float]]:
    return frozenset((t.item, t.size) for t in taken)
