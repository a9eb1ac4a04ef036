"""A candidate before the evidence: on which samples it is judged, beside what, and what they say of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
    def own(self) -> Products:
        """Of the candidate's columns alone."""
        k = len(self.low) - (0 if self.beside is None else len(self.beside.low))
        p = self.products
        return Products(p.own[:, :k, :k], p.cross[:, :, :k], p.right[:, :k], p.nulls[:k])

    def gain(self) -> Gain:
        """Log-likelihood gained by the candidate, and the amplitudes of all columns (k,)."""
        if self.beside is None:
            return self.evidence.gain(self.products, self.low, self.high)
        own = len(self.low) - len(self.beside.low)
        whole = self.evidence.gain(self.products, self.low, self.high, ABSORBED, own)
        return replace(whole, total=whole.total - self.beside.gain().total)

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

    def case(self, variant: Bounded, columns: Mapping[int, Parts]) -> Case:
        """A candidate's columns on whitened samples."""
        return self._case(self.evidence, self.whiten, variant, columns)

    def alone(self) -> "Samples":
        """The same samples with nothing beside a candidate."""
        return replace(self, beside={})

    def explained(self, variant: Bounded, columns: Mapping[int, Parts]) -> float:
        """Share of the plain residual's energy that a candidate explains, 0 to 1."""
        case = self._case(self.raw, self.plain, variant, columns)
        energy = sum(float(np.sum(self.raw.channels[c].residual ** 2)) for c in columns)
        if case.beside is not None:
            energy -= 2 * case.beside.gain().total
        return 2 * case.gain().total / max(energy, 1e-300)

    def _case(
        self,
        evidence: Evidence,
        bring: Callable[[int, Sequence[Array]], Array],
        variant: Bounded,
        columns: Mapping[int, Parts],
    ) -> Case:
        own = {c: bring(c, parts) for c, parts in columns.items()}
        if not self.beside:
            return Case(evidence, evidence.products(list(own.items())), variant.low, variant.high, tuple(own))
        others = {c: bring(c, self.beside[c]) for c in columns}
        zero = np.zeros(next(iter(others.values())).shape[1])
        beside = Case(evidence, evidence.products(list(others.items())), zero, zero + np.inf, tuple(own))
        products = evidence.products([(c, np.hstack([own[c], others[c]])) for c in own])
        low, high = np.concatenate([variant.low, zero]), np.concatenate([variant.high, zero + np.inf])
        return Case(evidence, products, low, high, tuple(own), beside)

    def foreseen(self, variant: Bounded, columns: Mapping[int, Parts], spread: float) -> float:
        """The same share in blocks that were not fitted to; may be negative."""
        energy = sum(float(np.sum(self.raw.channels[c].residual ** 2)) for c in columns)
        return float(2 * np.sum(self._case(self.raw, self.plain, variant, columns).fresh_gains(spread)) / energy)
