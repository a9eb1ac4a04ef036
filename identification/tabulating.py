"""Tables fitted to what a baseline leaves of a torque: their shape by evidence, their values with deviations.

A table's values v have a Gaussian prior with a squared-exponential kernel over its coordinates (Rasmussen and Williams
2006, chapter 2). Length and size are those of the greatest evidence; the baseline's parameters are free beside the
values, so that a table holds only what no law of the baseline can.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, eigh

from ..models.empirical import NAME, likelihood_values
from ..models.table import MOST, Table
from .fitting.schur import schur

Array = NDArray[np.float64]

LENGTHS = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Length scales that are tried [share of the coordinate's range]; two knots a length."""
DEVIATIONS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Standard deviations of the values that are tried [RMS torque of the channel]."""
_NUGGET = 1e-6  # of the kernel's variance: keeps it from being singular


@dataclass(frozen=True)
class Rest:
    """What a baseline leaves of a torque on one recording: residual (n_band,), the baseline's columns (n_band, p), how
    columns (n, k) come into the band (n_band, k), and the product of the noise's inverse covariance with columns."""

    residual: Array
    baseline: Array
    to_band: Callable[[Array], Array]
    solve: Callable[[Array], Array]


@dataclass(frozen=True)
class _Chosen:
    table: Table
    raw: list[Array]  # by recording (n_band, k), of the values v
    root: Array  # v = root z

    def columns(self, i: int) -> Array:
        """Of the whitened values z, for one recording."""
        return self.raw[i] @ self.root


def tabulate(
    at: str,
    wanted: Sequence[tuple[tuple[str, ...], str]],
    reads: Sequence[Sequence[Sequence[Array]]],
    rests: Sequence[Rest],
    size: float,
) -> tuple[tuple[Table, ...], dict[str, float]]:
    """Tables at a joint over the coordinates wanted, with their values, deviations, scores and curvatures by key.

    Parameters
    ----------
    at : str
        The joint.
    wanted : sequence of (coordinates, factor)
        Of each table.
    reads : sequence, of each table, of each recording
        Its coordinates, and last its factor, each (n,).
    rests : sequence of Rest
        Of each recording.
    size : float
        RMS torque of the joint [T].
    """
    always, residuals = [r.baseline for r in rests], [r.residual for r in rests]
    free = always[0].shape[1]

    def seen(raw: list[Array], others: Sequence[_Chosen]) -> tuple[Array, Array]:
        """Curvature and score of a table's values, with the baseline free and other tables known by their priors."""
        own = [
            np.hstack([b, *(o.columns(i) for o in others), r, y[:, None]])
            for i, (b, r, y) in enumerate(zip(always, raw, residuals, strict=True))
        ]
        gram: Array = np.sum([x.T @ rest.solve(x) for x, rest in zip(own, rests, strict=True)], axis=0)
        before = gram.shape[0] - 1 - raw[0].shape[1]
        gram[np.arange(free, before), np.arange(free, before)] += 1.0
        return schur(gram[:-1, :-1], gram[:-1, -1], before)

    chosen: list[_Chosen] = []
    for (over, times), read in zip(wanted, reads, strict=True):
        signals, factors = [x[:-1] for x in read], [x[-1] for x in read]
        best: tuple[float, _Chosen] | None = None
        for length in LENGTHS:
            steps = int(np.ceil(2 / length)) + 1
            if steps ** len(over) > MOST:
                continue
            ends = [
                (min(float(x[k].min()) for x in signals), max(float(x[k].max()) for x in signals))
                for k in range(len(over))
            ]
            table = Table(over, times, tuple(tuple(np.linspace(low, high, steps).tolist()) for low, high in ends))
            raw = [r.to_band(table.weights(x) * f[:, None]) for r, x, f in zip(rests, signals, factors, strict=True)]
            root = cholesky(kernel(table.shape, length), lower=True)
            curvature, score = seen(raw, chosen)
            for s, value in zip(DEVIATIONS, evidence(root.T @ curvature @ root, root.T @ score, size), strict=True):
                if best is None or value > best[0]:
                    best = value, _Chosen(table, raw, size * s * root)
        if best is not None and best[1].table.words not in [o.table.words for o in chosen]:
            chosen.append(best[1])
    own = [np.hstack([b, *(o.columns(i) for o in chosen)]) for i, b in enumerate(always)]
    solved = [rest.solve(x) for x, rest in zip(own, rests, strict=True)]
    matrix: Array = np.sum([a.T @ b for a, b in zip(own, solved, strict=True)], axis=0)
    score: Array = np.sum([b.T @ r for b, r in zip(solved, residuals, strict=True)], axis=0)
    curvature, left = schur(matrix, score, free)
    factorised = cho_factor(curvature + np.eye(len(left)), lower=True)
    amplitudes, spread = cho_solve(factorised, left), cho_solve(factorised, np.eye(len(left)))
    values: dict[str, float] = {}
    at_column = 0
    for o in chosen:
        part = slice(at_column, at_column + len(o.root))
        at_column = part.stop
        value = o.root @ amplitudes[part]
        std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", o.root, spread[part, part], o.root), 0.0))
        for name, v, d in zip(o.table.names, value, std, strict=True):
            values |= {f"{NAME}.{at}.{name}": float(v), f"std.{NAME}.{at}.{name}": float(d)}
        values |= likelihood_values(o.table, at, *seen(o.raw, [other for other in chosen if other is not o]))
    return tuple(o.table for o in chosen), values


def kernel(shape: Sequence[int], length: float) -> Array:
    """Squared-exponential covariance of unit variance at evenly spaced knots over [0, 1] along each coordinate."""
    at = np.array(list(product(*(np.linspace(0, 1, n) for n in shape))))
    apart = np.sum((at[:, None] - at[None, :]) ** 2, axis=2)
    return np.exp(-0.5 * apart / length**2) + _NUGGET * np.eye(len(at))


def evidence(matrix: Array, score: Array, size: float) -> Array:
    """Log evidence of each of DEVIATIONS, but for what all have in common, of values of unit prior in units of it."""
    curvature, turn = eigh(matrix)
    own = (size * np.array(DEVIATIONS))[:, None] ** 2
    spread = 1 + own * np.maximum(curvature, 0.0)
    return np.sum(0.5 * own * (turn.T @ score) ** 2 / spread - 0.5 * np.log(spread), axis=1)
