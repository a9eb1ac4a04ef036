"""Every formula of a few terms of the dictionary, and its evidence beside that of a table without a formula.

What the recordings say of a table's values f is score·f - f·curvature·f / 2, but for a constant. A table's own errors
go together over a length and along what the baseline can do; the curvature knows both, standard deviations do not. All
sets of kinds of terms are compared, with their shapes fitted, so no set has to be reached from a smaller one.

The log evidence of a set is half the chi-square that it takes, less half the logarithm of the table's whole chi-square
for each number of it: the width of a prior as wide as the table, over that of the posterior (the Occam factor: MacKay
1992). Sets of one size share their prior odds equally (Scott and Berger 2010). The table without a formula has the
evidence of its Gaussian prior, the lengths and deviations of `tabulating` taken as equally likely, and even odds with
all formulas together.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, eigh
from scipy.special import logsumexp

from ..models.table import Table
from .formula_terms import Term, dictionary
from .tabulating import DEVIATIONS, LENGTHS, evidence, kernel

Array = NDArray[np.float64]
Key = tuple[str, int]

MOST_TERMS = 3
_FINE = 4  # samples of a term a knot, where a table was fitted and not typed
_ALIKE = 1e-9  # of a column's square: what is left of one that the others span


@dataclass(frozen=True)
class Likelihood:
    """What is known of a table's values (k,): chi-square |y - R f|², R (r, k), y (r,); terms at samples ``x`` of the
    coordinates, each (n,), are the values ``onto`` (k, n) times them."""

    table: Table
    root: Array
    y: Array
    x: tuple[Array, ...]
    onto: Array
    nothing: float
    """Log evidence of a table without a formula, over that of no torque."""

    @property
    def energy(self) -> float:
        """Chi-square of no torque at all."""
        return float(self.y @ self.y)

    @property
    def number(self) -> float:
        """What one number of a formula costs in log evidence."""
        return 0.5 * float(np.log1p(self.energy))

    def columns(self, term: Term) -> Array:
        """A term's columns, whitened (r, 1 or 2)."""
        return self.root @ (self.onto @ term.columns(self.x))


@dataclass(frozen=True)
class WeighedFormula:
    """Terms with coefficients, the chi-square they leave, and log evidence over that of no torque."""

    terms: tuple[Term, ...]
    values: tuple[Array, ...]
    left: float
    log_evidence: float
    probability: float = 0.0

    @property
    def keys(self) -> frozenset[Key]:
        """Its terms without their shapes."""
        return frozenset(t.key for t in self.terms)


def likelihood(table: Table, values: Array, curvature: Array, score: Array, *, fitted: bool) -> Likelihood:
    """Of a table's values (k,) with curvature (k, k) and score (k,); ``fitted``: to samples between the knots too."""
    size, turn = eigh(curvature)
    sound = size > len(size) * np.finfo(float).eps * max(size.max(), np.finfo(float).tiny)
    root = np.sqrt(size[sound])[:, None] * turn[:, sound].T
    y = turn[:, sound].T @ score / np.sqrt(size[sound])
    rms, found = float(np.sqrt(np.mean(values**2))), []
    for length in LENGTHS:
        of = cholesky(kernel(table.shape, length), lower=True)
        found.append(evidence(of.T @ curvature @ of, of.T @ score, rms))
    nothing = float(logsumexp(found) - np.log(len(LENGTHS) * len(DEVIATIONS)))
    at = [np.array(k) for k in table.knots]
    if fitted:
        at = [np.linspace(k[0], k[-1], _FINE * (len(k) - 1) + 1) for k in at]
    x = tuple(g.ravel() for g in np.meshgrid(*at, indexing="ij"))
    onto = np.asarray(np.linalg.pinv(table.weights(x)) if fitted else np.eye(values.size), float)
    return Likelihood(table, root, y, x, onto, nothing)


def weighed_formulas(of: Likelihood) -> list[WeighedFormula]:
    """One for each set of kinds of terms, the most probable first; what is missing to one is no formula's."""
    search = _Search(of)
    sets = search.sets()
    fits = [search.fitted(s) for s in sets if len(s) < MOST_TERMS]
    refined = [search.refined(f) for f in fits]
    # The largest sets are many: those are fitted that could still be best, if fitting gave as much as it ever gave.
    gain = max((b.log_evidence - a.log_evidence for a, b in zip(fits, refined, strict=True)), default=0.0)
    rest = sorted((search.fitted(s) for s in sets if len(s) == MOST_TERMS), key=lambda f: -f.log_evidence)
    best = max((f.log_evidence for f in refined), default=-np.inf)
    for f in rest:
        f = search.refined(f) if f.log_evidence + gain > best else f
        best = max(best, f.log_evidence)
        refined.append(f)
    kinds = len(search.keys)
    ways = [comb(kinds + n - 1, n) for n in range(1, MOST_TERMS + 1)]
    odds = [f.log_evidence - np.log(2 * MOST_TERMS * ways[len(f.terms) - 1]) for f in refined]
    whole = logsumexp([*odds, of.nothing - np.log(2)])
    weighed = [replace(f, probability=float(np.exp(o - whole))) for f, o in zip(refined, odds, strict=True)]
    return sorted(weighed, key=lambda f: (-f.probability, f.left))


class _Search:
    """Columns of a dictionary, and what each adds beside others."""

    def __init__(self, of: Likelihood) -> None:
        self.of, self.terms = of, list(dictionary(of.table))
        columns = [of.columns(t) for t in self.terms]
        self.double = np.array([c.shape[1] == 2 for c in columns])
        # A single column's partner is zero: both kinds go through the same sums.
        self.first = np.stack([c[:, 0] for c in columns], 1)
        self.second = np.stack([c[:, -1] if c.shape[1] == 2 else 0 * c[:, 0] for c in columns], 1)
        self.keys = list(dict.fromkeys(t.key for t in self.terms))
        number = np.array([self.keys.index(t.key) for t in self.terms])
        self.of_key = [np.flatnonzero(number == k) for k in range(len(self.keys))]
        self.range = {
            key: (min(self.terms[i].shape for i in m), max(self.terms[i].shape for i in m))
            for key, m in zip(self.keys, self.of_key, strict=True)
        }

    def sets(self) -> list[tuple[Term, ...]]:
        """The best shapes on the grid for each set of keys: pairs exhaustively, triples from their best pairs."""
        found: dict[tuple[int, ...], tuple[float, tuple[int, ...]]] = {}

        def offer(members: Iterable[int], gain: float) -> None:
            chosen = tuple(sorted(members, key=lambda i: self._key_of[i]))
            key = tuple(self._key_of[i] for i in chosen)
            if gain > found.get(key, (0.0, ()))[0]:
                found[key] = gain, chosen

        def extend(members: tuple[int, ...], taken: float) -> None:
            gains = self.gains(members)
            for m in self.of_key:
                i = int(m[np.argmax(gains[m])])
                if gains[i] > 0:
                    offer((*members, i), taken + float(gains[i]))

        self._key_of = {int(i): k for k, m in enumerate(self.of_key) for i in m}
        alone = self.gains(())
        extend((), 0.0)
        for i in range(len(self.terms)):
            extend((i,), float(alone[i]))
        for n in range(3, MOST_TERMS + 1):
            for gain, members in [v for k, v in found.items() if len(k) == n - 1]:
                extend(members, gain)
            for key in combinations_with_replacement(range(len(self.keys)), n):
                for k in range(n) if key in found else ():
                    members = found[key][1]
                    rest = members[:k] + members[k + 1 :]
                    gains, m = self.gains(rest), self.of_key[self._key_of[members[k]]]
                    i = int(m[np.argmax(gains[m])])
                    offer((*rest, i), self.taken(rest) + float(gains[i]))
        return [tuple(self.terms[i] for i in members) for _, members in found.values()]

    def _basis(self, members: Sequence[int]) -> Array:
        parts = [c[:, [i]] for i in members for c in (self.first, self.second)[: 1 + self.double[i]]]
        if not parts:
            return np.zeros((len(self.of.y), 0))
        whole = np.hstack(parts)
        whole = whole / np.maximum(np.linalg.norm(whole, axis=0), np.finfo(float).tiny)
        left, size, _ = np.linalg.svd(whole, full_matrices=False)
        return left[:, size**2 > _ALIKE]

    def taken(self, members: Sequence[int]) -> float:
        """Chi-square that terms take."""
        return float(np.sum((self._basis(members).T @ self.of.y) ** 2))

    def gains(self, members: Sequence[int]) -> Array:
        """Chi-square that each term of the dictionary takes beside others (n_terms,); none where they span it."""
        basis = self._basis(members)
        y = self.of.y - basis @ (basis.T @ self.of.y)
        a, b = (c - basis @ (basis.T @ c) for c in (self.first, self.second))
        aa, bb, ab = (np.einsum("ij,ij->j", *p) for p in ((a, a), (b, b), (a, b)))
        ay, by = a.T @ y, b.T @ y
        own, other = (np.einsum("ij,ij->j", c, c) for c in (self.first, self.second))
        single = np.where(aa > _ALIKE * own, ay**2 / np.maximum(aa, np.finfo(float).tiny), 0.0)
        apart = aa * bb - ab**2
        good = self.double & (apart > _ALIKE * own * other)
        both = (bb * ay**2 - 2 * ab * ay * by + aa * by**2) / np.where(good, apart, 1.0)
        return np.where(self.double, np.where(good, both, 0.0), single)

    def fitted(self, terms: tuple[Term, ...]) -> WeighedFormula:
        """Coefficients by least squares."""
        parts = [self.of.columns(t) for t in terms]
        whole = np.concatenate(parts, axis=1)
        found = np.asarray(np.linalg.lstsq(whole, self.of.y)[0], float)
        left = float(np.sum((self.of.y - whole @ found) ** 2))
        numbers = len(found) + sum(t.shaped for t in terms)
        cuts = np.cumsum([p.shape[1] for p in parts])[:-1]
        log_evidence = 0.5 * (self.of.energy - left) - numbers * self.of.number
        return WeighedFormula(terms, tuple(np.split(found, cuts)), left, log_evidence)

    def refined(self, start: WeighedFormula) -> WeighedFormula:
        """Shapes between the points of the grid, by Gauss and Newton's steps, halved until they help."""
        free = [k for k, t in enumerate(start.terms) if t.shaped]
        best = start
        for _ in range(10 if free else 0):
            columns = [self.of.columns(t) for t in best.terms]
            slopes = []
            for k in free:
                t, (low, high) = best.terms[k], self.range[best.terms[k].key]
                step = 1e-5 * (high - low)
                ahead = self.of.columns(replace(t, shape=t.shape + step))
                slopes.append((ahead - columns[k]) @ best.values[k] / step)
            whole = np.column_stack([*columns, *slopes])
            left = self.of.y - np.concatenate(columns, axis=1) @ np.concatenate(best.values)
            move = np.linalg.lstsq(whole, left)[0][-len(free) :]
            for part in (1.0, 0.5, 0.25, 0.1):
                terms = list(best.terms)
                for k, m in zip(free, move, strict=True):
                    terms[k] = replace(
                        terms[k], shape=float(np.clip(terms[k].shape + part * m, *self.range[terms[k].key]))
                    )
                tried = self.fitted(tuple(terms))
                if tried.left < best.left:
                    break
            else:
                return best
            done = best.left - tried.left < 1e-3
            best = tried
            if done:
                break
        return best
