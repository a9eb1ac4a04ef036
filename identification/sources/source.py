"""One interface for a kind of recording: its measurements, a model's predictions of them, and its candidates.

A kind of recording is one package with a `Source`. Fit, evidence, search and confirmation use nothing else of it.
Letters: n samples of a recording, c channels, P free parameters of effects, S shifts.
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
    """A model's effects with the values of their free parameters (P,), and the shifts (S,) in deviations."""

    placed: tuple[PlacedEffect, ...]
    fixed: dict[str, float]
    values: Array
    shifts: Array

    @staticmethod
    def of(placed: Sequence[PlacedEffect], values: Mapping[str, float], n_shifts: int) -> "ModelPoint":
        """Effects at these values by key, without shifts."""
        return ModelPoint((), {}, np.zeros(0), np.zeros(n_shifts)).with_effects(placed, values)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys ``effect.place.parameter`` of the free parameters."""
        return tuple(f"{p.key}.{x.name}" for p, x in self.free)

    @property
    def free(self) -> list[tuple[PlacedEffect, Parameter]]:
        """The free parameters, each with its effect."""
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
        """This model with more effects, at these values."""
        return self._with((*self.placed, *added), self.all_values | dict(values))

    def without(self, *keys: str) -> "ModelPoint":
        """This model without some effects."""
        return self._with(tuple(p for p in self.placed if p.key not in keys), self.all_values)

    def held(self, count: int) -> "ModelPoint":
        """This model with the first ``count`` free parameters held at their values."""
        known = set(self.keys[:count])
        placed = [
            replace(p, hold=(*p.hold, *(x.name for x in p.effect.parameters if f"{p.key}.{x.name}" in known)))
            for p in self.placed
        ]
        return self._with(tuple(placed), self.all_values)

    def _with(self, placed: tuple[PlacedEffect, ...], every: Mapping[str, float]) -> "ModelPoint":
        held = {f"{p.key}.{h}": every[f"{p.key}.{h}"] for p in placed for h in p.hold}
        empty = ModelPoint(placed, held, np.zeros(0), self.shifts)
        return replace(empty, values=np.array([every[k] for k in empty.keys], float))


@dataclass(frozen=True)
class GridPoint:
    """An effect at one point of its grid: values by key, and the parameters in which each column is linear; none where
    one column is the whole law. ``size`` is a usual amplitude of the column, where the channels do not give it; of a
    whole law, its RMS as a share of its channel's. ``origin``: the values that amplitudes are counted from, by key;
    else zero. ``inverse``: a whole law does the less, the larger its parameter is.
    """

    placed: PlacedEffect
    values: Mapping[str, float]
    amplitudes: tuple[str, ...]
    size: float = 0.0
    origin: Mapping[str, float] = field(default_factory=dict)
    inverse: bool = False

    @property
    def count(self) -> int:
        """Columns that stand for the law."""
        return max(len(self.amplitudes), 1)


@dataclass(frozen=True)
class Linearisation:
    """Recordings linearised about a fit: residuals (n, c) of each, and derivatives (n, c, P + S) by the parameters, in
    their units, and by the shifts, in deviations.
    """

    at: ModelPoint
    residuals: tuple[Array, ...]
    columns: tuple[Array, ...]


class Source(Protocol):
    """Recordings of one kind: the training recordings first, then the held-out ones."""

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
        """How many numbers of the set-up may differ from their stated values, each with a standard deviation."""
        ...

    @property
    def anew(self) -> bool:
        """Whether the evidence chooses how well the shifts are known: to a share of their deviations, or not at all."""
        ...

    @property
    def bent(self) -> bool:
        """Whether the derivatives by the shifts change over a fit, and are computed again at each of its steps."""
        ...

    @property
    def steps(self) -> int:
        """Largest number of steps of a fit."""
        ...

    def measured(self, i: int) -> Array:
        """Measurements (n, c); not a number where there are none."""
        ...

    def predicted(self, i: int, at: ModelPoint) -> Array | None:
        """Channels that the model predicts (n, c); None where it cannot predict them."""
        ...

    def refused(self, i: int) -> InputError:
        """The error for a recording that the model cannot predict."""
        ...

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        """Derivatives (n, c, P) of the prediction ``here`` by the free parameters."""
        ...

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        """Derivatives (n, c, S) of the prediction by the shifts."""
        ...

    def own_shifts(self, p: PlacedEffect) -> tuple[int, ...]:
        """Numbers of the shifts that are the tolerance of an effect's own parameters, which it exceeds."""
        ...

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        """The model with the shifts of these recordings read from them."""
        ...

    def scale(self) -> Array:
        """RMS of each channel in the training recordings (c,); sizes are shares of it."""
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
        """Every effect at every place that the model does not have."""
        ...

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """Points of an effect's grid."""
        ...

    def columns(self, i: int, at: ModelPoint, many: Sequence[GridPoint]) -> list[Array]:
        """What each effect by itself adds to the prediction of the model (n, c, k); not a number where it cannot be
        predicted."""
        ...

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        """Nameless curves by channel and by their coordinates in words: columns (n, k) for each recording."""
        ...

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        """What the noise of every channel of every recording depends on; ``could`` (n, k) are the columns, by channel
        and recording, that may explain the residuals.
        """
        ...

    def blocks(self, i: int, x: Array) -> Array:
        """Sums over blocks of time."""
        ...
