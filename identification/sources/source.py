"""One interface for a kind of recording: what was measured, what values predict of it, and what else can act.

A kind is one package that offers a `Source`; fit, evidence, search and confirmation see nothing else of it. Letters: n
samples of a recording, c channels, P free parameters of effects, S shifts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.effect import Parameter
from ...models.model import PlacedEffect
from ..nuisance.noise import NoiseChannel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModelPoint:
    """Effects with their free parameters' values (P,), and shifts (S,) in their deviations."""

    placed: tuple[PlacedEffect, ...]
    fixed: dict[str, float]
    values: Array
    shifts: Array

    @staticmethod
    def of(placed: Sequence[PlacedEffect], values: Mapping[str, float], n_shifts: int) -> "ModelPoint":
        """Effects at these values by key, nothing shifted."""
        return ModelPoint((), {}, np.zeros(0), np.zeros(n_shifts)).with_effects(placed, values)

    @property
    def keys(self) -> tuple[str, ...]:
        """Free parameters by ``effect.place.parameter``."""
        return tuple(f"{p.key}.{x.name}" for p, x in self.free)

    @property
    def free(self) -> list[tuple[PlacedEffect, Parameter]]:
        """Free parameters with their effects."""
        return [(p, x) for p in self.placed for x in p.effect.parameters if x.name not in p.hold]

    @property
    def all_values(self) -> dict[str, float]:
        """Every parameter of the effects by its key."""
        return self.fixed | dict(zip(self.keys, map(float, self.values), strict=True))

    def of_effect(self, p: PlacedEffect) -> Array:
        """Every parameter of one effect (p,)."""
        every = self.all_values
        return np.array([every[f"{p.key}.{x.name}"] for x in p.effect.parameters])

    def with_effects(self, added: Sequence[PlacedEffect], values: Mapping[str, float]) -> "ModelPoint":
        """With more effects at these values."""
        return self._with((*self.placed, *added), self.all_values | dict(values))

    def without(self, *keys: str) -> "ModelPoint":
        """Without some effects."""
        return self._with(tuple(p for p in self.placed if p.key not in keys), self.all_values)

    def _with(self, placed: tuple[PlacedEffect, ...], every: Mapping[str, float]) -> "ModelPoint":
        held = {f"{p.key}.{h}": every[f"{p.key}.{h}"] for p in placed for h in p.hold}
        empty = ModelPoint(placed, held, np.zeros(0), self.shifts)
        return replace(empty, values=np.array([every[k] for k in empty.keys], float))


@dataclass(frozen=True)
class GridPoint:
    """An effect at one point of its grid: values by key, and the parameters that each column is in proportion to; none
    where the one column is all that the law does. ``size``: a usual one of the column's amplitude, where the channels
    do not tell it; of a whole law, its RMS as a share of its channel's. ``origin``: where amplitudes are counted from,
    by key; else from zero. ``inverse``: a whole law does the less, the larger its parameter is."""

    placed: PlacedEffect
    values: Mapping[str, float]
    amplitudes: tuple[str, ...]
    size: float = 0.0
    origin: Mapping[str, float] = field(default_factory=dict)
    inverse: bool = False


@dataclass(frozen=True)
class Linearisation:
    """What recordings say about a fit: residuals (n, c) of each, and columns (n, c, P + S) of what is free there, in
    units of the parameters and of the shifts' deviations."""

    at: ModelPoint
    residuals: tuple[Array, ...]
    columns: tuple[Array, ...]


class Source(Protocol):
    """Recordings of one kind: those for training first, then the held-out ones."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names."""
        ...

    @property
    def train(self) -> range:
        """Numbers of the training recordings."""
        ...

    @property
    def held(self) -> range:
        """Numbers of the held-out recordings."""
        ...

    @property
    def n_shifts(self) -> int:
        """Numbers beside the effects that may be others than they are said to be, with a deviation each."""
        ...

    @property
    def anew(self) -> bool:
        """Whether shifts may be known to a share of their deviations, which the evidence chooses, or not at all."""
        ...

    @property
    def steps(self) -> int:
        """Most steps of a fit that are worth their time."""
        ...

    def measured(self, i: int) -> Array:
        """Measurements (n, c); not a number where there are none."""
        ...

    def predicted(self, i: int, at: ModelPoint) -> Array | None:
        """Channels as the model predicts them (n, c); None where it cannot."""
        ...

    def refused(self, i: int) -> InputError:
        """What is wrong with a recording that the model cannot predict."""
        ...

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        """Derivatives (n, c, P) by the free parameters about what is predicted ``here``."""
        ...

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        """Derivatives (n, c, S) by the shifts."""
        ...

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        """With what is some recordings' own read off them."""
        ...

    def scale(self) -> Array:
        """What sizes are shares of (c,): RMS of each channel in the training recordings."""
        ...

    def bounds(self, p: PlacedEffect, x: Parameter) -> tuple[float, float]:
        """Physical bounds of a parameter."""
        ...

    def size(self, p: PlacedEffect, x: Parameter) -> float:
        """A usual size of a parameter."""
        ...

    def unit(self, p: PlacedEffect, x: Parameter) -> str:
        """Its unit."""
        ...

    def library(self, placed: Sequence[PlacedEffect]) -> list[PlacedEffect]:
        """Every effect at every place that is not there yet."""
        ...

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """Points of an effect's grid."""
        ...

    def columns(self, i: int, at: ModelPoint, v: GridPoint) -> Array:
        """What an effect adds beside those that are there (n, c, k); not a number where it cannot be predicted."""
        ...

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        """Nameless curves by channel and what they run over in words: columns (n, k) for each recording."""
        ...

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        """What the noise of every channel of every recording depends on; ``could`` (n, k) by channel and recording may
        explain the residuals."""
        ...

    def blocks(self, i: int, x: Array) -> Array:
        """Sums over blocks of time."""
        ...
