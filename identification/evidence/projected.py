"""The evidence of some recordings together, with the baseline and every nuisance projected out.

With S = K + A A' as in `evidence`: H = C' S⁻¹ C and g = C' S⁻¹ r of every item, and what is left of the rest. Most of
what stands beside belongs to one channel, so that cost grows with the channels and not with their square.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from .evidence import Evidence, ItemStack

Array = NDArray[np.float64]
Index = NDArray[np.int_]

ROUNDING = 1e-14
"""Share of a sum's trace that its rounding may take from its smallest eigenvalue."""


@dataclass(frozen=True)
class ProjectedStack(ItemStack):
    """Items with their curvature (N, k, k) and score (N, k), the nuisance columns projected out."""

    curvature: Array
    score: Array


class ProjectedEvidence:
    """The evidence of some recordings together, with all nuisance columns projected out."""

    def __init__(
        self,
        evidence: Evidence,
        recordings: Sequence[int],
        weight: Array | None = None,
        known: tuple[Array, Array] | None = None,
    ) -> None:
        """``weight`` (P,): factors on the prior deviations of what always stands beside. ``known``: mean (m,) and
        covariance (m, m) of the first m of them, from other recordings; in place of their prior."""
        self.evidence, self.recordings = evidence, tuple(recordings)
        n_always = evidence.n_always
        self._weight = np.ones(n_always) if weight is None else weight
        matrix, seen = np.zeros((n_always, n_always)), np.zeros(n_always)
        score, sums = np.zeros(evidence.n_columns), []
        energy = log_det = 0.0
        for c, numbers in enumerate(evidence.numbers):
            index = np.unique(np.concatenate([evidence.channels[i][c].index for i in recordings]))
            beside = np.zeros((len(index), len(numbers)))
            for i in recordings:
                products, own = evidence.products(i, c), evidence.channels[i][c].index
                matrix[np.ix_(own, own)] += products.always
                seen[own] += products.seen
                beside[np.searchsorted(index, own)] += products.beside
                score[numbers] += products.score
                energy, log_det = energy + products.energy, log_det + products.log_det
            sums.append((index, beside))
        turned, self._mean = np.diag(self._weight), np.zeros(n_always)
        m = 0
        if known is not None:
            mean, covariance = known
            m = len(mean)
            self._mean[:m] = mean
            energy += float(mean @ matrix[:m, :m] @ mean - 2 * mean @ seen[:m])
            seen = seen - matrix[:, :m] @ mean
            turned[:m, :m] = _root(covariance)
            matrix, seen = turned.T @ matrix @ turned, turned.T @ seen
        else:
            matrix, seen = matrix * np.outer(self._weight, self._weight), seen * self._weight
        self._turned = turned
        self._order, self._alone = _arrow([index for index, _ in sums], n_always, m)
        # Sums of columns that differ by many orders of magnitude are positive definite but for their rounding.
        rounding = ROUNDING * float(np.trace(matrix)) if n_always else 0.0
        matrix = (0.5 * (matrix + matrix.T))[np.ix_(self._order, self._order)]
        self._low = cholesky(matrix + (1 + rounding) * np.eye(n_always), lower=True)
        self._seen = solve_triangular(self._low, seen[self._order], lower=True)
        self.null = float(-0.5 * (energy - self._seen @ self._seen + log_det) - np.sum(np.log(np.diag(self._low))))
        self._project(sums, score)
        self._crossed: dict[int, Array] = {}
        self._left: dict[int, float] = {}
        self.groups = self._grouped()
        self._at = {int(x): (g, row) for g in self.groups for row, x in enumerate(g.numbers)}

    def _project(self, sums: Sequence[tuple[Index, Array]], score: Array) -> None:
        """What stands beside in the columns' way, L⁻¹ A'K⁻¹C: a row a column, of its channel's own parameters and of
        those that channels share; the others are zero. ``sums``: parameters of a channel (p,), and A'K⁻¹C (p, m)."""
        common = slice(self._alone[-1].stop if self._alone else 0, len(self._order))
        shared = np.zeros((len(self._order) - common.start, self.evidence.n_columns))
        at_common = np.full(len(self._order), -1)
        at_common[self._order[common]] = np.arange(len(shared))
        for (index, beside), numbers in zip(sums, self.evidence.numbers, strict=True):
            where = at_common[index]
            shared[np.ix_(where[where >= 0], numbers)] += beside[where >= 0]
        shared = self._turned[np.ix_(self._order[common], self._order[common])].T @ shared
        self._own: list[Array] = []
        self.score_all = score
        for (index, beside), numbers, rows in zip(sums, self.evidence.numbers, self._alone, strict=True):
            own = self._order[rows]
            given = self._weight[own, None] * beside[np.searchsorted(index, own)]
            found = solve_triangular(self._low[rows, rows], given, lower=True)
            shared[:, numbers] -= self._low[common, rows] @ found
            self.score_all[numbers] -= found.T @ self._seen[rows]
            self._own.append(np.ascontiguousarray(found.T))
        self._common = common
        self._shared = np.ascontiguousarray(solve_triangular(self._low[common, common], shared, lower=True).T)
        self.score_all -= self._shared @ self._seen[common]

    def _grouped(self) -> list[ProjectedStack]:
        made = [np.zeros((*x.index.shape, x.index.shape[1])) for x in self.evidence.alike]
        for c, where in enumerate(self.evidence.where):
            for i in self.recordings:
                for total, (rows, own) in zip(made, self.evidence.own(i, c), strict=True):
                    total[rows] += own
            for total, x in zip(made, self.evidence.alike, strict=True):
                at = where[x.index]
                rows = np.flatnonzero(at[:, 0] >= 0)
                beside = self._own[c][at[rows]]
                total[rows] -= beside @ beside.transpose(0, 2, 1)
        groups = []
        for x, curvature in zip(self.evidence.alike, made, strict=True):
            beside = self._shared[x.index]
            curvature -= beside @ beside.transpose(0, 2, 1)
            curvature *= x.spread[:, :, None] * x.spread[:, None, :]
            score = self.score_all[x.index] * x.spread
            groups.append(ProjectedStack(x.numbers, x.index, x.spread, x.positive, x.whole, curvature, score))
        return groups

    def left(self, c: int) -> float:
        """e' K⁻¹ e of a channel of all these recordings, e what is left by all that stands beside, at its mean."""
        if c not in self._left:
            always, total = self.beside([]), 0.0
            for i in self.recordings:
                own = self.evidence.channels[i][c]
                e = own.residual - own.columns @ always[own.index]
                total += float(e @ own.covariance.solve(e))
            self._left[c] = total
        return self._left[c]

    def cross(self, number: int) -> Array:
        """C_item' S⁻¹ C of an item, in units of its spread, with every column (k, m)."""
        if number not in self._crossed:
            item = self.evidence.items[number]
            total = -self._shared[item.index] @ self._shared.T
            for c in self.evidence.reached(item):
                own = -self._own[c][self.evidence.where[c][item.index]] @ self._own[c].T
                for i in self.recordings:
                    own += self.evidence.row(i, c, number)
                total[:, self.evidence.numbers[c]] += own
            self._crossed[number] = total * item.spread[:, None]
        return self._crossed[number]

    def score(self, number: int) -> Array:
        """C_item' S⁻¹ r, in units of its spread (k,)."""
        item = self.evidence.items[number]
        return self.score_all[item.index] * item.spread

    def own(self, number: int) -> Array:
        """C_item' S⁻¹ C_item, in units of its spread (k, k)."""
        group, row = self._at[number]
        return group.curvature[row]

    def curvature(self, one: int, other: int) -> Array:
        """C_one' S⁻¹ C_other in units of their spreads (k_one, k_other)."""
        item = self.evidence.items[other]
        return self.cross(one)[:, item.index] * item.spread

    def curvatures(self, numbers: Sequence[int]) -> Array:
        """C' S⁻¹ C of several items side by side, in units of their spreads.

        Of many a set only the value is asked for, so that what the last has in common with every column, which is
        dear, is not worked out.
        """
        blocks = [[self.own(x) if x == y else np.zeros((0, 0)) for y in numbers] for x in numbers]
        for k, x in enumerate(numbers):
            for later, y in enumerate(numbers[k + 1 :], k + 1):
                blocks[k][later] = self.curvature(x, y)
                blocks[later][k] = blocks[k][later].T
        return np.block(blocks)

    def posterior(self, m: int) -> tuple[Array, Array]:
        """Mean (m,) and covariance (m, m) of the first m parameters beside, with no hypothesis."""
        first = np.eye(len(self._low))[self._order, :m]
        half = solve_triangular(self._low, first * self._weight[:m], lower=True)
        return self.beside([])[:m], half.T @ half

    def beside(self, members: Sequence[tuple[int, Array]]) -> Array:
        """Posterior mean (P,) of the nuisance columns' amplitudes, given items at amplitudes."""
        seen = self._seen.copy()
        for number, amplitude in members:
            item = self.evidence.items[number]
            added = item.spread * amplitude
            seen[self._common] -= added @ self._shared[item.index]
            for c in self.evidence.reached(item):
                seen[self._alone[c]] -= added @ self._own[c][self.evidence.where[c][item.index]]
        found = np.zeros(len(seen))
        found[self._order] = solve_triangular(self._low.T, seen, lower=False)
        return self._mean + self._turned @ found

    def added(self, i: int, c: int, number: int, amplitudes: Array) -> Array:
        """What a channel of a recording has more of by an item (n,): what the item adds, less what it takes over from
        the columns that stand beside. A curve over a law's own coordinate may take over most of the law."""
        given, own = [(number, amplitudes)], self.evidence.channels[i][c]
        back = (self.beside(given) - self.beside([]))[own.index]
        return self.evidence.contribution(i, c, self.evidence.items[number], amplitudes) + own.columns @ back


def _root(covariance: Array) -> Array:
    """Lower L with L L' a covariance (m, m), but for its rounding; what does not vary has no part in it."""
    varies, found = np.ix_(*[np.flatnonzero(np.diag(covariance) > 0)] * 2), np.zeros_like(covariance)
    own = covariance[varies]
    if len(own):
        found[varies] = cholesky(own + 1e-12 * np.trace(own) * np.eye(len(own)) / len(own), lower=True)
    return found


def _arrow(indices: Sequence[Index], count: int, common: int) -> tuple[Index, list[slice]]:
    """An order of all parameters beside, those that one channel alone has first, channel by channel, and where each
    channel's stand in it: so arranged, nothing fills in as the normal matrix is factorised (an arrow).

    ``indices``: parameters of each channel; the first ``common`` count as shared, whoever has them.
    """
    has = np.zeros(count, int)
    for index in indices:
        has[index] += 1
    has[:common] = 0
    alone = [index[has[index] == 1] for index in indices]
    stops = np.cumsum([0, *map(len, alone)])
    order = np.concatenate([*alone, np.setdiff1d(np.arange(count), np.concatenate(alone))]).astype(int)
    return order, [slice(int(a), int(b)) for a, b in pairwise(stops)]
