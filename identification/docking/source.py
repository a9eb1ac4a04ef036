"""Docking tests as a source: a simulation, with derivatives by finite differences.

The shifts are numbers of the set-up, machining and the pose's registration (`SHIFTS`), the same in all recordings.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.docking.bench_setup import DockingTree, docking_effects
from ...models.effect import Parameter
from ...models.effects import get_effect
from ...models.model import Model, PlacedEffect
from ..deciding import BLOCK
from ..nuisance.noise import NoiseChannel
from ..sources.fit import changes, differences, shift_differences
from ..sources.source import GridPoint, Linearisation, ModelPoint
from .noise import noise_channels
from .recording import EVERY, load_records
from .runs import SHIFTS, DockingRuns

Array = NDArray[np.float64]


class Dockings(DockingRuns):
    """Docking tests of a model, the training recordings first."""

    n_shifts, anew, bent, steps = len(SHIFTS), False, False, 4

    def __init__(self, model: Model, train: Sequence[str | Path], held: Sequence[str | Path] = ()) -> None:
        """Read the recordings; raises InputError for whatever is wrong with one."""
        setup = model.tree_as(DockingTree).setup
        if not train:
            raise InputError("recordings: none is given; give one or more")
        super().__init__(setup, load_records(model, [*train, *held]))
        self.train, self.held = range(len(train)), range(len(train), len(self.records))
        self.channels = self.records[0].channels

    def measured(self, i: int) -> Array:
        return self.records[i].measured

    def predicted(self, i: int, at: ModelPoint) -> Array | None:
        return self(i, at.all_values, at.shifts)

    def refused(self, i: int) -> InputError:
        return InputError(
            f"{self.records[i].path}: the docking cannot be simulated from where the recording starts; check "
            "[docking] against the test's set-up"
        )

    def slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        return differences(self, i, at, here)

    def shift_slopes(self, i: int, at: ModelPoint, here: Array) -> Array:
        return shift_differences(self, i, at, here)

    def own_shifts(self, p: PlacedEffect) -> tuple[int, ...]:
        return tuple(k for k, name in enumerate(SHIFTS) if name.startswith(f"{p.key}."))

    def settled(self, at: ModelPoint, numbers: Sequence[int]) -> ModelPoint:
        return at

    def scale(self) -> Array:
        return self.sizes(self.train)

    def sizes(self, numbers: Sequence[int]) -> Array:
        """RMS of each channel (c,) since the start, in some recordings."""
        every = np.concatenate([self.records[i].measured - self.records[i].measured[0] for i in numbers])
        return np.maximum(np.sqrt(np.nanmean(every**2, axis=0)), 1e-12)

    def bounds(self, p: PlacedEffect, x: Parameter) -> tuple[float, float]:
        return x.low, x.high

    def size(self, p: PlacedEffect, x: Parameter) -> float:
        return min(abs(g) for g in x.grid)

    def unit(self, p: PlacedEffect, x: Parameter) -> str:
        return x.unit

    def library(self, placed: Sequence[PlacedEffect]) -> list[PlacedEffect]:
        have = {p.key for p in placed}
        every = [PlacedEffect(get_effect(name), at) for name, places in docking_effects().items() for at in places]
        return [p for p in every if p.key not in have]

    def variants(self, p: PlacedEffect) -> list[GridPoint]:
        """A parameter that is zero where there is no effect is an amplitude."""
        amplitudes = [x for x in p.effect.parameters if x.zero == 0]
        shapes = [x for x in p.effect.parameters if x.zero != 0]
        found = []
        for shape in product(*(x.grid for x in shapes)):
            for k in range(max(len(x.grid) for x in amplitudes)):
                values = {f"{p.key}.{x.name}": v for x, v in zip(shapes, shape, strict=True)}
                values |= {f"{p.key}.{x.name}": x.grid[k % len(x.grid)] for x in amplitudes}
                found.append(GridPoint(p, values, tuple(f"{p.key}.{x.name}" for x in amplitudes)))
        return found

    def columns(self, i: int, at: ModelPoint, many: Sequence[GridPoint]) -> list[Array]:
        return [self._column(i, at, v) for v in many]

    def _column(self, i: int, at: ModelPoint, v: GridPoint) -> Array:
        """Change of the simulation for each amplitude, from zero."""
        shape = {k: x for k, x in v.values.items() if k not in v.amplitudes}
        none = self.predicted(i, at)
        assert none is not None
        steps = {key: v.values[key] for key in v.amplitudes}
        return changes(none, ((self(i, {**at.all_values, **shape, k: x}, at.shifts), x) for k, x in steps.items()))

    def curves(self, numbers: Sequence[int]) -> Mapping[tuple[int, str], list[Array]]:
        return {}

    def noise_channels(
        self, numbers: Sequence[int], linear: Linearisation, could: Sequence[Sequence[Array]]
    ) -> list[list[NoiseChannel]]:
        return noise_channels([self.records[i] for i in numbers], linear, could, self.scale())

    def blocks(self, i: int, x: Array) -> Array:
        count = max(round(BLOCK / EVERY), 1)
        return np.array([b.sum() for b in np.array_split(x, max(len(x) // count, 4))])


def start(model: Model) -> ModelPoint:
    """The model as given; a parameter without a value starts at what hardware usually has."""
    usual = {f"{p.key}.{x.name}": x.grid[0] for p in model.effects for x in p.effect.parameters}
    return ModelPoint.of(model.effects, usual | {k: v for k, v in model.values.items() if k in usual}, len(SHIFTS))
