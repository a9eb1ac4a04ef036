"""How much a candidate explains when the whole baseline is fitted again beside it, and whether that is chance.

All in whitened samples, where the log-likelihood gained by adding columns C to a baseline X is ½ sᵀS⁻¹s with
s = Cᵀ(y − X g), S = CᵀC − CᵀX (XᵀX)⁻¹ XᵀC (the Schur complement; Frisch & Waugh 1933). Products are kept per time
block, so that leaving a block out, a block bootstrap, and nulls with signs flipped per block (wild bootstrap: Liu
1988) cost nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

ABSORBED = 1e-3
"""A column of which the baseline can mimic all but this share is no candidate."""

ABSORBED_PART = 0.02
"""The same for every column of a candidate that has several: an alias must not ride along."""

KNOWN = 0.05
"""Share of a left-out block's own curvature that stays: what only that block can tell is held near zero step, where
nothing else would hold it at all."""

NOTHING = 1e-15
"""Energy of a whitened column, for an amplitude of one, below which it is rounding."""


@dataclass(frozen=True)
class Channel:
    """One whitened channel: baseline columns (n, k) for the parameters ``index``, residual (n,), noise (n,), block
    (n,)."""

    index: NDArray[np.int_]
    columns: Array
    residual: Array
    noise: Array
    block: NDArray[np.int_]

    @cached_property
    def rows(self) -> list[tuple[int, slice]]:
        """Runs of samples in one block, each with the block's number; none where no sample of the joint moves."""
        edges = [0, *np.flatnonzero(np.diff(self.block)) + 1, len(self.block)]
        return [(int(self.block[a]), slice(int(a), int(b))) for a, b in pairwise(edges) if a < b]


@dataclass(frozen=True)
class Products:
    """Sums over the samples of each block, B blocks, P baseline parameters, k candidate columns."""

    own: Array
    """(B, k, k): CᵀC."""
    cross: Array
    """(B, P, k): XᵀC."""
    right: Array
    """(B, k): Cᵀy."""
    nulls: Array
    """(k, R): Cᵀ of R sign-flipped noises."""

    def only(self, columns: NDArray[np.int_]) -> "Products":
        """Those of some of the columns."""
        own = self.own[:, columns[:, None], columns]
        return Products(own, self.cross[:, :, columns], self.right[:, columns], self.nulls[columns])


@dataclass(frozen=True)
class Gain:
    """Of one candidate: log-likelihood gained, its amplitudes (k,), and the least share of a column that the
    baseline cannot mimic: 0 gain, and ``mimicked``, where that is too little."""

    total: float
    amplitudes: Array
    unabsorbed: float
    mimicked: bool = False


class Evidence:
    """Baseline sums of all channels, ready to judge candidates.

    Parameters
    ----------
    channels : sequence of Channel
    n_parameters, n_blocks : int
    n_nulls : int
        Sign-flipped noise series.
    seed : int
    """

    def __init__(
        self, channels: Sequence[Channel], n_parameters: int, n_blocks: int, n_nulls: int = 200, seed: int = 0
    ) -> None:
        """Sum the baseline's products per block."""
        rng = np.random.default_rng(seed)
        self.signs = rng.choice([-1.0, 1.0], (n_blocks, n_nulls))
        self.channels, self.n_blocks = tuple(channels), n_blocks
        self.matrix = np.zeros((n_blocks, n_parameters, n_parameters))
        self.right = np.zeros((n_blocks, n_parameters))
        self.energy = np.zeros(n_blocks)
        noise = np.zeros((n_parameters, n_blocks))
        for c in channels:
            for b, rows in c.rows:
                x = c.columns[rows]
                self.matrix[b][np.ix_(c.index, c.index)] += x.T @ x
                self.right[b, c.index] += x.T @ c.residual[rows]
                self.energy[b] += c.residual[rows] @ c.residual[rows]
                noise[c.index, b] += x.T @ c.noise[rows]
        self.nulls = noise @ self.signs
        self.size = sum(len(c.residual) for c in channels)
        self._total = _Solver(self.matrix.sum(0))
        self._fitted = self._total.solve(self.right.sum(0))
        self._null_fitted = self._total.solve(self.nulls)

    def products(self, columns: Sequence[tuple[int, Array]]) -> Products:
        """Sums for a candidate given as (channel number, whitened columns (n, k)), same k on every channel."""
        k = columns[0][1].shape[1]
        own = np.zeros((self.n_blocks, k, k))
        cross = np.zeros((self.n_blocks, self.matrix.shape[1], k))
        right = np.zeros((self.n_blocks, k))
        noise = np.zeros((k, self.n_blocks))
        for number, values in columns:
            c = self.channels[number]
            for b, rows in c.rows:
                part = values[rows]
                own[b] += part.T @ part
                cross[b, c.index] += c.columns[rows].T @ part
                right[b] += part.T @ c.residual[rows]
                noise[:, b] += part.T @ c.noise[rows]
        return Products(own, cross, right, noise @ self.signs)

    def side_by_side(
        self, columns: Sequence[tuple[int, Array]], p: Products, others: Mapping[int, Array], q: Products
    ) -> Products:
        """Sums for columns with others after them, from what each has alone."""
        between = np.zeros((self.n_blocks, p.own.shape[1], q.own.shape[1]))
        for number, values in columns:
            for b, rows in self.channels[number].rows:
                between[b] += values[rows].T @ others[number][rows]
        own = np.block([[p.own, between], [between.transpose(0, 2, 1), q.own]])
        cross, right = (np.concatenate(x, axis=-1) for x in ((p.cross, q.cross), (p.right, q.right)))
        return Products(own, cross, right, np.concatenate([p.nulls, q.nulls]))

    def gain(
        self, p: Products, low: Array, high: Array, least: float | None = None, counted: int | None = None
    ) -> Gain:
        """Log-likelihood gained on all blocks by the candidate, amplitudes between bounds, baseline fitted again.

        ``least`` is the share of every column, or of the first ``counted``, that the baseline must not be able to
        mimic.
        """
        cross = p.cross.sum(0)
        own = p.own.sum(0)
        schur = own - cross.T @ self._total.solve(cross)
        # A column that is nothing but rounding is no candidate.
        left = np.where(np.diag(own) > NOTHING, np.diag(schur) / np.maximum(np.diag(own), NOTHING), 0.0)[:counted]
        unabsorbed = float(np.min(left)) if len(left) > 1 else float(left[0])
        if unabsorbed < (least or (ABSORBED if len(left) == 1 else ABSORBED_PART)):
            return Gain(0.0, np.zeros(len(low)), unabsorbed, mimicked=True)
        target = p.right.sum(0) - cross.T @ self._fitted
        amplitudes = _bounded(schur, own, target, low, high)
        return Gain(float(target @ amplitudes - 0.5 * amplitudes @ schur @ amplitudes), amplitudes, unabsorbed)

    def null_gains(self, p: Products) -> Array:
        """The same gain on every sign-flipped noise (R,), without bounds."""
        cross = p.cross.sum(0)
        own = p.own.sum(0)
        schur = _Solver(own - cross.T @ self._total.solve(cross), np.diag(own))
        target = p.nulls - cross.T @ self._null_fitted
        return 0.5 * np.sum(target * schur.solve(target), axis=0)

    def fresh_gains(self, p: Products, low: Array, high: Array, spread: float = np.inf) -> Array:
        """Log-likelihood gained on each block by a fit to the other blocks (B,).

        ``spread`` is the standard deviation about zero of each amplitude before anything was measured: nameless curves
        run wild without one where only the block left out has been.
        """
        ridge = np.eye(len(low)) / spread**2
        gains = np.zeros(self.n_blocks)
        cross_of_all, own_of_all, right_of_all = p.cross.sum(0), p.own.sum(0), p.right.sum(0)
        for b, (solver, right, without) in enumerate(self._left_out):
            cross = cross_of_all - (1 - KNOWN) * p.cross[b]
            own = own_of_all - (1 - KNOWN) * p.own[b]
            schur = own + ridge - cross.T @ solver.solve(cross)
            amplitudes = _bounded(
                schur, own + ridge, right_of_all - p.right[b] - cross.T @ solver.solve(right), low, high
            )
            beside = solver.solve(right - cross @ amplitudes)
            gains[b] = 0.5 * (without - self._energy(b, beside, p, amplitudes))
        return gains

    @cached_property
    def _left_out(self) -> list[tuple["_Solver", Array, float]]:
        """Of each block: the baseline's solver and products (P,) without it, and the energy that their fit leaves."""
        matrix, right, found = self.matrix.sum(0), self.right.sum(0), []
        for b in range(self.n_blocks):
            solver, others = _Solver(matrix - (1 - KNOWN) * self.matrix[b]), right - self.right[b]
            found.append((solver, others, self._energy(b, solver.solve(others))))
        return found

    def shares(self, p: Products, amplitudes: Array) -> Array:
        """Log-likelihood gained on each block by the fit to all of them (B,)."""
        beside = self._total.solve(self.right.sum(0) - p.cross.sum(0) @ amplitudes)
        return np.array(
            [
                0.5 * (self._energy(b, self._fitted) - self._energy(b, beside, p, amplitudes))
                for b in range(self.n_blocks)
            ]
        )

    def likeness(self, a: Mapping[int, Array], b: Mapping[int, Array]) -> float:
        """Cosine between two whitened signals (channel to (n,)) once the baseline has taken its part of each."""
        size = self.matrix.shape[1]
        shadow = {name: np.zeros(size) for name in "ab"}
        for name, signal in (("a", a), ("b", b)):
            for number, values in signal.items():
                c = self.channels[number]
                shadow[name][c.index] += c.columns.T @ values
        both = float(sum(a[c] @ b[c] for c in a.keys() & b.keys())) - shadow["a"] @ self._total.solve(shadow["b"])
        own = [
            float(sum(x @ x for x in signal.values())) - shadow[name] @ self._total.solve(shadow[name])
            for name, signal in (("a", a), ("b", b))
        ]
        return float(both / np.sqrt(max(own[0] * own[1], 1e-300)))

    def smallest(self, p: Products, column: int, needed: float) -> float:
        """Amplitude of one of a candidate's columns that would gain ``needed``, the baseline fitted again beside it."""
        cross = p.cross.sum(0)
        schur = float((p.own.sum(0) - cross.T @ self._total.solve(cross))[column, column])
        return float(np.sqrt(2 * needed / max(schur, 1e-300)))

    def _energy(self, b: int, theta: Array, p: Products | None = None, amplitudes: Array | None = None) -> float:
        """Squared residual of a block at baseline step ``theta`` and a candidate's amplitudes."""
        energy = self.energy[b] - 2 * self.right[b] @ theta + theta @ self.matrix[b] @ theta
        if p is not None and amplitudes is not None:
            energy += -2 * p.right[b] @ amplitudes + amplitudes @ p.own[b] @ amplitudes
            energy += 2 * theta @ p.cross[b] @ amplitudes
        return float(energy)


class _Solver:
    """Solves with a normal matrix whose weak directions are left alone.

    ``reference`` is the diagonal before a baseline took its share: a column with nothing left of it is left out.
    """

    def __init__(self, matrix: Array, reference: Array | None = None) -> None:
        diagonal = np.diag(matrix)
        floor = 1e-9 * (reference if reference is not None else np.max(diagonal, initial=0.0) * 1e-12) + 1e-300
        self.scale = np.where(diagonal > floor, np.sqrt(np.maximum(diagonal, 1e-300)), np.inf)
        values, vectors = np.linalg.eigh(matrix / np.outer(self.scale, self.scale))
        keep = values > 1e-9 * max(values[-1], 1e-300) if len(values) else np.zeros(0, bool)
        self.half = vectors[:, keep] / np.sqrt(values[keep])

    def solve(self, right: Array) -> Array:
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return self.half @ (self.half.T @ (right / scale)) / scale


def _bounded(schur: Array, own: Array, target: Array, low: Array, high: Array) -> Array:
    """Minimise ½ aᵀSa − targetᵀa between bounds; ``own`` is S before the baseline took its share."""
    solver = _Solver(schur, np.diag(own))
    free = solver.solve(target)
    if np.all(free >= low) and np.all(free <= high):
        return free
    scale = np.where(np.isfinite(solver.scale), solver.scale, 1e150)
    values, vectors = np.linalg.eigh(schur / np.outer(scale, scale))
    root = (vectors * np.sqrt(np.maximum(values, 1e-12 * values[-1]))).T
    right = np.linalg.lstsq(root.T, target / scale, rcond=None)[0]
    answer = lsq_linear(root, right, bounds=(low * scale, high * scale), method="bvls")
    return answer.x / scale
