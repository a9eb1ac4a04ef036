"""The evidence of some recordings together, the baseline and every nuisance that stands beside projected out.

With S = K + A A' as in `evidence`: H = C' S⁻¹ C and g = C' S⁻¹ r of every item, and what is left of the rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from .evidence import Evidence, ItemStack

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ProjectedStack(ItemStack):
    """Items with their curvature (N, k, k) and score (N, k), the nuisance columns projected out."""

    curvature: Array
    score: Array


class ProjectedEvidence:
    """The evidence of some recordings together, what always stands beside projected out."""

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
        n_always, n_columns = evidence.n_always, evidence.n_columns
        self._weight = np.ones(n_always) if weight is None else weight
        matrix, seen = np.zeros((n_always, n_always)), np.zeros(n_always)
        beside, score = np.zeros((n_always, n_columns)), np.zeros(n_columns)
        energy = log_det = 0.0
        for i in recordings:
            for c, (own, numbers) in enumerate(zip(evidence.channels[i], evidence.numbers, strict=True)):
                products = evidence.products(i, c)
                matrix[np.ix_(own.index, own.index)] += products.always
                seen[own.index] += products.seen
                beside[np.ix_(own.index, numbers)] += products.beside
                score[numbers] += products.score
                energy, log_det = energy + products.energy, log_det + products.log_det
        turned, self._mean = np.diag(self._weight), np.zeros(n_always)
        if known is not None:
            mean, covariance = known
            m = len(mean)
            self._mean[:m] = mean
            energy += float(mean @ matrix[:m, :m] @ mean - 2 * mean @ seen[:m])
            seen = seen - matrix[:, :m] @ mean
            turned[:m, :m] = cholesky(covariance + 1e-12 * np.trace(covariance) * np.eye(m) / max(m, 1), lower=True)
            matrix, seen, beside = turned.T @ matrix @ turned, turned.T @ seen, turned.T @ beside
        else:
            matrix, seen = matrix * np.outer(self._weight, self._weight), seen * self._weight
            beside = self._weight[:, None] * beside
        self._turned = turned
        # Sums of columns that differ by many orders of magnitude are positive definite but for their rounding.
        rounding = 1e-14 * float(np.trace(matrix)) if n_always else 0.0
        self._low = cholesky(0.5 * (matrix + matrix.T) + (1 + rounding) * np.eye(n_always), lower=True)
        self._seen = solve_triangular(self._low, seen, lower=True)
        self.null = float(-0.5 * (energy - self._seen @ self._seen + log_det) - np.sum(np.log(np.diag(self._low))))
        self.beside_all = solve_triangular(self._low, beside, lower=True)
        self.score_all = score - self.beside_all.T @ self._seen
        self._crossed: dict[int, Array] = {}
        self._left: dict[int, float] = {}
        self.groups = self._grouped()
        self._at = {int(x): (g, row) for g in self.groups for row, x in enumerate(g.numbers)}

    def _grouped(self) -> list[ProjectedStack]:
        made = [np.zeros((*x.index.shape, x.index.shape[1])) for x in self.evidence.alike]
        for c in range(len(self.evidence.where)):
            for i in self.recordings:
                for total, (rows, own) in zip(made, self.evidence.own(i, c), strict=True):
                    total[rows] += own
        groups = []
        for x, curvature in zip(self.evidence.alike, made, strict=True):
            beside = self.beside_all[:, x.index]
            curvature -= np.einsum("pak,pal->akl", beside, beside, optimize=True)
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
            total = np.zeros((len(item.index), self.evidence.n_columns))
            for c in self.evidence.reached(item):
                for i in self.recordings:
                    total[:, self.evidence.numbers[c]] += self.evidence.row(i, c, number)
            total -= self.beside_all[:, item.index].T @ self.beside_all
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
        half = solve_triangular(self._low, np.eye(len(self._low))[:, :m] * self._weight[:m], lower=True)
        return self.beside([])[:m], half.T @ half

    def beside(self, members: Sequence[tuple[int, Array]]) -> Array:
        """Posterior mean of what always stands beside (P,) given items at amplitudes."""
        seen = self._seen.copy()
        for number, amplitude in members:
            item = self.evidence.items[number]
            seen -= self.beside_all[:, item.index] @ (item.spread * amplitude)
        return self._mean + self._turned @ solve_triangular(self._low.T, seen, lower=False)
