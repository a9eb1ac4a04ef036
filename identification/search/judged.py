"""A candidate before the evidence: on which samples it is judged, beside what, and what they say of it."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...models.model import Placed
from .candidates import Variant
from .evidence import ABSORBED, Evidence, Gain, Products

Array = NDArray[np.float64]
Parts = list[Array]
"""One array an experiment."""


@dataclass(frozen=True)
class Case:
    """A candidate's columns before the evidence, with those that stand beside it at no price.

    Parameters
    ----------
    evidence : Evidence
    products : Products
        Of k columns: the candidate's, then those beside it.
    low, high : array (k,)
        Bounds of the amplitudes.
    reached : tuple of int
        Channels that the candidate reaches.
    beside : Case or None
        The latter alone.
    """

    evidence: Evidence
    products: Products
    low: Array
    high: Array
    reached: tuple[int, ...]
    beside: "Case | None" = None

    @property
    def _n_own(self) -> int:
        return len(self.low) - (0 if self.beside is None else len(self.beside.low))

    @property
    def own(self) -> Products:
        """Of the candidate's columns alone."""
        return self.products.only(np.arange(self._n_own))

    def only(self, columns: NDArray[np.int_]) -> "Case":
        """The candidate with some of its columns, and all that stand beside them."""
        if len(columns) == self._n_own:
            return self
        kept = np.concatenate([columns, np.arange(self._n_own, len(self.low))])
        return replace(self, products=self.products.only(kept), low=self.low[kept], high=self.high[kept])

    def gain(self) -> Gain:
        """Log-likelihood gained by the candidate, and the amplitudes of all columns (k,)."""
        if self.beside is None:
            return self._plain_gain
        whole = self.evidence.gain(self.products, self.low, self.high, ABSORBED, self._n_own)
        return replace(whole, total=whole.total - self.beside.gain().total)

    @cached_property
    def _plain_gain(self) -> Gain:
        return self.evidence.gain(self.products, self.low, self.high)

    def share(self) -> float:
        """Share of the innovations' energy that the candidate explains, 0 to 1."""
        energy = sum(float(np.sum(self.evidence.channels[c].residual ** 2)) for c in self.reached)
        return 2 * self.gain().total / max(energy, 1e-300)

    def fresh_gains(self, spread: float = np.inf) -> Array:
        """Log-likelihood gained by the candidate on each block left out (B,); ``spread`` as `Evidence` takes it."""
        fresh = self.evidence.fresh_gains(self.products, self.low, self.high, spread)
        return fresh if self.beside is None else fresh - self.beside.fresh_gains()

    def shares(self) -> Array:
        """Log-likelihood gained by the candidate on each block by the fit to all of them (B,)."""
        own = self.evidence.shares(self.products, self.gain().amplitudes)
        return own if self.beside is None else own - self.beside.shares()


@dataclass(frozen=True)
class Judged:
    """A candidate and what the recordings say of it.

    Parameters
    ----------
    variant : Variant
        Best point of the effect's shape grid, and the amplitudes that the data asks for.
    placed : Placed
        Effect and place, with the parameters to hold.
    amplitudes : array (k,)
    score : float
        Log-likelihood gained, less ½ log(samples) for each parameter.
    price : float
        What was taken off.
    explained : float
        Share of the residual energy of the channels it reaches, 0 to 1.
    channels : tuple of int
        Channels it reaches.
    case : Case
        What it is judged on.
    columns : mapping of int to array (n_white, k)
        Its whitened columns in motion on each channel.
    everywhere : callable
        Makes a variant's columns by channel, near rest too, from the motion as measured: one array an experiment.
    """

    variant: Variant
    placed: Placed
    amplitudes: Array
    score: float
    price: float
    explained: float
    channels: tuple[int, ...]
    case: Case
    columns: Mapping[int, Array]
    everywhere: Callable[[Variant], Mapping[int, Parts]]

    def among(self, samples: "Samples") -> "Judged":
        """The same candidate judged on samples near rest, too."""
        case = samples.case(self.variant, self.everywhere(self.variant))
        return replace(self, case=case, score=case.gain().total - self.price)

    def signal(self) -> dict[int, Array]:
        """What it explains of each channel, whitened (n_white,)."""
        return {c: x @ self.amplitudes for c, x in self.columns.items()}

    def start(self) -> dict[str, float]:
        """Starting values by key for the joint refit."""
        full = self.variant.start(self.amplitudes)
        names = [p.name for p in self.placed.effect.parameters]
        return {f"{self.placed.key}.{name}": float(value) for name, value in zip(names, full, strict=True)}


class Bounded(Protocol):
    """Anything whose amplitudes have bounds, each (k,)."""

    @property
    def low(self) -> Array:
        """Lower ones."""
        ...

    @property
    def high(self) -> Array:
        """Upper ones."""
        ...


@dataclass(frozen=True)
class Samples:
    """The samples that candidates are judged on, whitened and plain.

    Parameters
    ----------
    evidence, raw : Evidence
        Of whitened samples, and of plain ones in units of each channel's residual.
    whiten, plain : callable
        Make columns of a channel, one array an experiment, into rows of either.
    beside : mapping of int to Parts
        Columns that stand beside every candidate on a channel, with amplitudes that are not negative.
    """

    evidence: Evidence
    raw: Evidence
    whiten: Callable[[int, Sequence[Array]], Array]
    plain: Callable[[int, Sequence[Array]], Array]
    beside: Mapping[int, Parts]
    store: dict[Hashable, tuple[dict[int, Array], Case]] = field(default_factory=dict, repr=False)
    """Of the columns beside candidates, what was made of them."""

    def case(self, variant: Bounded, columns: Mapping[int, Parts]) -> Case:
        """A candidate's columns on whitened samples."""
        return self.cases([(variant, columns)])[0]

    def cases(self, candidates: Sequence[tuple[Bounded, Mapping[int, Parts]]]) -> list[Case]:
        """The same of candidates that reach the same channels; all at once costs little more than one."""
        return self._cases(self.evidence, self.whiten, candidates)

    def alone(self) -> "Samples":
        """The same samples with nothing beside a candidate."""
        return replace(self, beside={})

    def explained(self, variant: Bounded, columns: Mapping[int, Parts]) -> float:
        """Share of the plain residual's energy that a candidate explains, 0 to 1."""
        (case,) = self._cases(self.raw, self.plain, [(variant, columns)])
        energy = sum(float(np.sum(self.raw.channels[c].residual ** 2)) for c in columns)
        if case.beside is not None:
            energy -= 2 * case.beside.gain().total
        return 2 * case.gain().total / max(energy, 1e-300)

    def _cases(
        self,
        evidence: Evidence,
        bring: Callable[[int, Sequence[Array]], Array],
        candidates: Sequence[tuple[Bounded, Mapping[int, Parts]]],
    ) -> list[Case]:
        reached = tuple(candidates[0][1])
        own = []
        for c in reached:
            parts = zip(*(columns[c] for _, columns in candidates), strict=True)
            own.append((c, bring(c, [np.concatenate(x, axis=1) for x in parts])))
        low, high = (np.concatenate([getattr(v, side) for v, _ in candidates]) for side in ("low", "high"))
        whole = Case(evidence, evidence.products(own), low, high, reached)
        if self.beside:
            others, beside = self._others(evidence, bring, reached)
            products = evidence.side_by_side(own, whole.products, others, beside.products)
            low, high = np.concatenate([low, beside.low]), np.concatenate([high, beside.high])
            whole = Case(evidence, products, low, high, reached, beside)
        ends = np.cumsum([len(v.low) for v, _ in candidates])
        return [whole.only(np.arange(end - len(v.low), end)) for (v, _), end in zip(candidates, ends, strict=True)]

    def _others(
        self, evidence: Evidence, bring: Callable[[int, Sequence[Array]], Array], reached: tuple[int, ...]
    ) -> tuple[dict[int, Array], Case]:
        """Columns that stand beside a candidate, and what they explain alone."""
        key = (evidence is self.raw, reached)
        if key not in self.store:
            others = {c: bring(c, self.beside[c]) for c in reached}
            zero = np.zeros(next(iter(others.values())).shape[1])
            products = evidence.products(list(others.items()))
            self.store[key] = others, Case(evidence, products, zero, zero + np.inf, reached)
        return self.store[key]

    def foreseen(self, variant: Bounded, columns: Mapping[int, Parts], spread: float) -> float:
        """The same share in blocks that were not fitted to; may be negative."""
        energy = sum(float(np.sum(self.raw.channels[c].residual ** 2)) for c in columns)
        (case,) = self._cases(self.raw, self.plain, [(variant, columns)])
        return float(2 * np.sum(case.fresh_gains(spread)) / energy)
