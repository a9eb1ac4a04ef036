"""Small recordings with everything that could explain them, and the same as dense matrices, for brute force."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from snarelab.identification.evidence.evidence import Evidence, ResidualChannel
from snarelab.identification.evidence.pool import CandidateColumns, Hypothesis, Item
from snarelab.identification.nuisance.covariance import Covariance, LaggedNoise

STEP = 0.02


@dataclass
class Explained:
    """Recordings i of channels c; ``pieces[i][c]``: residual, its covariance, positions and columns beside."""

    pieces: list[list[ResidualChannel]]
    columns: CandidateColumns
    items: list[Item]
    n_always: int

    def evidence(self) -> Evidence:
        return Evidence(self.pieces, self.columns, self.items, self.n_always)

    def stacked(self, recordings: Sequence[int]):
        """Residual (n,), covariance (n, n), what always stands beside (n, P), and every pool column (n, m)."""
        residual, noise, always, pool = [], [], [], []
        for i in recordings:
            for c, own in enumerate(self.pieces[i]):
                n = len(own.residual)
                residual.append(own.residual)
                noise.append(own.covariance.dense())
                a, b = np.zeros((n, self.n_always)), np.zeros((n, self.columns.count))
                a[:, own.index] = own.columns
                numbers, x = self.columns.of(i, c)
                b[:, numbers] = x
                always.append(a)
                pool.append(b)
        k = np.asarray(block_diag(*noise), float)
        return np.concatenate(residual), k, np.concatenate(always), np.concatenate(pool)

    def log_density(self, recordings: Sequence[int], taken=(), weight=None) -> float:
        """Of all samples of some recordings, given (number of the item, prior deviation of its amplitudes)."""
        r, k, a, pool = self.stacked(recordings)
        a = a * (np.ones(self.n_always) if weight is None else weight)
        k = k + a @ a.T
        mean = np.zeros(len(r))
        for number, size in taken:
            item = self.items[number]
            c = pool[:, item.index] * item.spread
            k = k + size**2 * c @ c.T
            mean = mean + c[:, 0] * item.whole
        whole: Any = k
        return float(multivariate_normal(mean, whole).logpdf(r))


def covariance(rng, n) -> Covariance:
    """Of unequal samples, coloured and wandering noise, and encoders'."""
    processes = [LaggedNoise(0.4, 0.1), LaggedNoise(0.3, 8.0)]
    return Covariance(rng.uniform(0.5, 1.5, n), processes, rng.uniform(0.1, 0.6, n), STEP, (slice(0, n),))


def explained(seed: int, sizes=((40, 40), (30, 30))) -> Explained:
    """Two recordings of two channels; of five parameters beside three act on each channel. Six items: of one column
    on either channel, of three on one, one that cannot be negative, a whole law, and one that shares columns
    with others."""
    rng = np.random.default_rng(seed)
    columns = CandidateColumns([n for n, _ in sizes])

    def add(channels, k):
        return columns.add({c: [rng.normal(size=(n[c], k)) for n in sizes] for c in channels})

    def item(index, *, positive=False, whole=False):
        k = len(index)
        spread = np.ones(1) if whole else rng.uniform(0.5, 2.0, k)
        return Item(index, spread, np.full(k, positive), whole)

    first, both, three, last = add([0], 1), add([0, 1], 2), add([1], 3), add([0, 1], 1)
    items = [
        item(first),
        item(both),
        item(three),
        item(first, positive=True),
        item(last, whole=True),
        item(np.concatenate([last, both])),
    ]
    beside = [np.array([0, 1, 4]), np.array([1, 2, 3])]
    pieces = []
    for i, n in enumerate(sizes):
        row = []
        for c in range(2):
            own, x = covariance(rng, n[c]), rng.normal(size=(n[c], 3))
            effect = columns.some(i, c, both).sum(axis=1) + (columns.some(i, 1, three)[:, 0] if c else 0.0)
            noise = np.linalg.cholesky(own.dense()) @ rng.normal(size=n[c])
            row.append(ResidualChannel(noise + x @ rng.normal(size=3) + 0.4 * effect, own, beside[c], x))
        pieces.append(row)
    return Explained(pieces, columns, items, 5)


def hypotheses(items: Sequence[Item], odds: float, named: Sequence[bool] | None = None) -> list[Hypothesis]:
    """One of each item, of these prior odds each."""
    flags = [True] * len(items) if named is None else named
    return [
        Hypothesis(f"h{k}", f, (x,), float(np.log(odds))) for k, (x, f) in enumerate(zip(items, flags, strict=True))
    ]


def white(rng, n_columns: int, planted: dict[int, float], n=200, spread=1.0) -> Explained:
    """One channel of unit white noise, single columns of unit RMS, and effects planted: column number, amplitude."""
    columns = CandidateColumns([n])
    x = rng.normal(size=(n, n_columns))
    x /= np.sqrt(np.mean(x**2, axis=0))
    index = columns.add({0: [x]})
    items = [Item(np.array([k]), np.array([spread]), np.zeros(1, bool)) for k in index]
    residual = rng.normal(size=n) + sum(a * x[:, k] for k, a in planted.items())
    own = Covariance(np.ones(n), [], None, STEP, (slice(0, n),))
    return Explained([[ResidualChannel(residual, own, np.zeros(0, int), np.zeros((n, 0)))]], columns, items, 0)
