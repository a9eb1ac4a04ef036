"""A set of hypotheses that are taken as true, and the gain of one more."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import log_ndtr

from .. import deciding
from ..deciding import WHOLE
from .projected import ProjectedEvidence

Array = NDArray[np.float64]

SIZES = np.array(deciding.SIZES)


class Members:
    """Items with their sizes; ``value`` is their log Bayes factor against nothing.

    A law without amplitudes has its prior about one, and a small spread.
    """

    def __init__(self, on: ProjectedEvidence, taken: Sequence[tuple[int, float]] = ()) -> None:
        """``taken``: (number of the item, size)."""
        self.on, self.taken = on, tuple(taken)
        self.value = 0.0
        self.amplitudes = np.zeros(0)
        items = [on.evidence.items[x] for x, _ in self.taken]
        stops = np.cumsum([len(x.index) for x in items]) if items else np.zeros(0, int)
        self._slices = {
            number: slice(int(b - len(x.index)), int(b))
            for (number, _), x, b in zip(self.taken, items, stops, strict=True)
        }
        if not self.taken:
            return
        sizes = [WHOLE if x.whole else size for x, (_, size) in zip(items, self.taken, strict=True)]
        self._deviation = np.concatenate([np.full(len(x.index), s) for x, s in zip(items, sizes, strict=True)])
        mean = np.concatenate([np.full(len(x.index), float(x.whole)) for x in items])
        curvature = on.curvatures([x for x, _ in self.taken])
        score = np.concatenate([on.score(x) for x, _ in self.taken])
        shift = curvature @ mean
        news = (score - shift) * self._deviation
        self._low = cholesky(np.eye(len(mean)) + curvature * np.outer(self._deviation, self._deviation), lower=True)
        u = cho_solve((self._low, True), news)
        self.amplitudes = mean + self._deviation * u
        self.value = float(mean @ score - 0.5 * mean @ shift + 0.5 * news @ u - np.sum(np.log(np.diag(self._low))))

    def of(self, number: int) -> Array:
        """Posterior mean amplitudes of a member by the number of its item, in units of its spread."""
        return self.amplitudes[self._slices[number]]

    def gains(self) -> Array:
        """Log Bayes factor of every item on top of these members, for each size (N, n_sizes); a law without amplitudes
        has the first only, the others are -inf.
        """
        found = np.full((len(self.on.evidence.items), len(SIZES)), -np.inf)
        if self.taken:
            cross = np.concatenate([self.on.cross(x) for x, _ in self.taken])
            explained = self.amplitudes @ cross
            turned = solve_triangular(self._low, self._deviation[:, None] * cross, lower=True)
        for group in self.on.groups:
            curvature, score = group.curvature, group.score
            if self.taken:
                own = turned[:, group.index] * group.spread
                curvature = curvature - np.einsum("qak,qal->akl", own, own, optimize=True)
                score = score - explained[group.index] * group.spread
            if group.whole:
                found[group.numbers, 0] = log_bayes_whole(curvature[:, 0, 0], score[:, 0])
            else:
                found[group.numbers] = log_bayes(curvature, score, group.positive)
        return found


def log_bayes(curvature: Array, score: Array, positive: NDArray[np.bool_]) -> Array:
    """½ g'(H + κ⁻²)⁻¹g - ½ log det(1 + κ²H) of N items (N, k, k), (N, k) for each size κ: (N, n_sizes).

    An amplitude that cannot be negative has half the prior, doubled: a factor 2 Φ(mean / deviation)."""
    values, vectors = np.linalg.eigh(curvature)
    values, turned = np.maximum(values, 0.0)[:, None, :], np.einsum("akl,ak->al", vectors, score)[:, None, :]
    k2 = (SIZES**2)[None, :, None]
    found = np.sum(-0.5 * np.log1p(k2 * values) + 0.5 * k2 * turned**2 / (1 + k2 * values), axis=2)
    rows = np.flatnonzero(positive.any(axis=1))
    if len(rows):
        share = k2 / (1 + k2 * values[rows])  # posterior variance along each eigenvector
        mean = np.einsum("asl,akl->ask", share * turned[rows], vectors[rows])
        deviation = np.sqrt(np.maximum(np.einsum("asl,akl->ask", share, vectors[rows] ** 2), 1e-300))
        sign = np.log(2) + log_ndtr(mean / deviation)
        found[rows] += np.sum(np.where(positive[rows][:, None, :], sign, 0.0), axis=2)
    return found


def log_bayes_whole(curvature: Array, score: Array) -> Array:
    """Log Bayes factors (N,) of columns of which each is a whole law, with an amplitude about one."""
    h = np.maximum(curvature, 0.0)
    left = score - h
    k2 = WHOLE**2
    return score - 0.5 * h - 0.5 * np.log1p(k2 * h) + 0.5 * k2 * left**2 / (1 + k2 * h)


def left_by(on: ProjectedEvidence, pairs: Sequence[tuple[int, float]], recordings: Sequence[int]) -> list[Array]:
    """What a set of items, with their sizes, leaves of recordings beside all that always stands (n, J)."""
    members, items = Members(on, pairs), on.evidence.items
    mean = [(item, members.of(item)) for item, _ in pairs]
    always, given = on.beside(mean), [(items[item], amplitudes) for item, amplitudes in mean]
    return [on.evidence.left(i, always, given).residual for i in recordings]
