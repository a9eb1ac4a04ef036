"""A fit, split into the smallest problems that share no parameter, each with its own channels and parameters.

Friction of one joint says nothing about friction of another while the inertia is trusted: seven small problems settle
each at its own pace, and none waits for, or is evaluated for, the slowest.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ...models.effect import Parameter
from ...models.hidden_state import rows
from ...models.model import PlacedEffect
from ...models.rig.kinematics import reached_joints
from ...models.rig.rig import Rig
from .assembly import Block, TorqueModel
from .experiment import Experiment
from .least_squares import NormalEquations, Objective, Solution
from .periodogram import pair_products
from .projection import minimise_projected, project
from .rig_places import PLACES
from .wave_lengths import wave_peaks

Array = NDArray[np.float64]
Index = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Problem:
    """Some channels, and the part of a model that they depend on.

    Parameters
    ----------
    assembly : TorqueModel
        With the effects that reach these channels only; P parameters.
    experiments : tuple of Experiment
    channels : array (c,) of int
    index : array (P,) of int
        Where its parameters stand in the whole model's.
    """

    assembly: TorqueModel
    experiments: tuple[Experiment, ...]
    channels: Index
    index: Index

    @cached_property
    def grids(self) -> list[list[tuple[int, Array]]]:
        """Of each placed effect with free shape parameters: their positions in theta and starting values."""
        return [[(i, self._starts(p, x)) for i, x in own] for p, own in self._free_shapes]

    @cached_property
    def shapes(self) -> NDArray[np.bool_]:
        """Whether the torque is nonlinear in a parameter (P,)."""
        mask = np.zeros(len(self.index), bool)
        mask[[i for _, own in self._free_shapes for i, _ in own]] = True
        return mask

    @cached_property
    def _free_shapes(self) -> list[tuple[PlacedEffect, list[tuple[int, Parameter]]]]:
        """Each placed effect with its free shape parameters and their positions in theta."""
        found = []
        for p in self.assembly.placed:
            position = {self.assembly.slots[i].name: int(i) for i in self.assembly.index_of(p)}
            own = [(position[x.name], x) for x in p.effect.parameters if x.grid and x.name in position]
            if own:
                found.append((p, own))
        return found

    def _starts(self, p: PlacedEffect, x: Parameter) -> Array:
        """Starting values of a shape: its grid, or the lengths of waves at the peaks of a periodogram."""
        usual = self.assembly.origin(p, x) + np.array(x.grid) * self.assembly.scale(p, x)
        return self._lengths(p, x, usual) if x.periodic_over else usual

    def _lengths(self, p: PlacedEffect, x: Parameter, usual: Array) -> Array:
        """Lengths at the peaks of what a fit without an effect leaves, with every other shape where it starts."""
        kept = self.assembly.keep([o for o in self.assembly.placed if o.key != p.key], self.assembly.start)
        rest = Problem(kept, self.experiments, self.channels, np.arange(len(kept.slots)))
        sigma = rest.rms(kept.start) + 1e-12
        theta, _, _ = project(rest.objective(sigma), kept.start, rest.shapes)
        states = [kept.evaluate(e, theta) for e in self.experiments]
        residuals = [e.measured - e.all_to_band(s.tau) for e, s in zip(self.experiments, states, strict=True)]
        levels = dict(zip(map(int, self.channels), sigma, strict=True))

        def weighed(i: int, c: int) -> tuple[Array, Callable[[Array, Array], Array]] | None:
            if c not in levels:
                return None
            return residuals[i][:, c] / levels[c] ** 2, lambda x, y: pair_products([x, y], [x, y]) / levels[c] ** 2

        found = wave_peaks(self.assembly, p, x, self.experiments, states, weighed)
        return usual if found is None else 1 / found.waves

    def minimise(self, theta: Array, sigma: Array, tolerance: float = 1e-8) -> Solution:
        """Best parameters from one start, channels weighted by 1 / sigma (c,)."""
        return minimise_projected(self.objective(sigma), theta, self.shapes, tolerance=tolerance)

    def objective(self, sigma: Array) -> Objective:
        """The objective, with channels weighted by 1 / sigma (c,)."""
        return Objective(lambda x: self.normal(x, sigma), self.assembly.low, self.assembly.high)

    def channel_fits(self, experiment: Experiment, theta: Array) -> Iterator[tuple[Array, Index, Array]]:
        """Of each channel in band: residual (n_band,), parameters it depends on (k,), its derivative (n_band, k)."""
        state = self.assembly.evaluate(experiment, theta)
        for channel in self.channels:
            banded = []
            for b in state.blocks:
                if b.channel != channel or not len(b.index):
                    continue
                columns = None if b.key is None else experiment.store.get(b.key)
                if columns is None:
                    columns = experiment.to_band(b.values, channel)
                    if b.key is not None:
                        experiment.store[b.key] = columns
                banded.append(Block(b.channel, b.index, columns))
            index, columns = gather(banded, channel)
            residual = experiment.measured[:, channel] - experiment.to_band(state.tau[:, channel], channel)
            yield residual, index, columns.reshape(len(residual), len(index))

    def normal(self, theta: Array, sigma: Array) -> NormalEquations:
        """Cost, gradient and normal matrix, channels weighted by 1 / sigma (c,); inf where torque is not finite."""
        size = len(theta)
        cost, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
        # A trial far out may overflow: that is an answer, not a fault.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for experiment in self.experiments:
                for (residual, index, columns), s in zip(self.channel_fits(experiment, theta), sigma, strict=True):
                    cost += 0.5 * float(residual @ residual) / s**2
                    if len(index):
                        gradient[index] -= columns.T @ residual / s**2
                        matrix[np.ix_(index, index)] += columns.T @ columns / s**2
        finite = np.isfinite(cost) and np.isfinite(gradient).all() and np.isfinite(matrix).all()
        return NormalEquations(cost if finite else np.inf, gradient, matrix)

    def rms(self, theta: Array) -> Array:
        """RMS residual of each of its channels in the analysis band (c,)."""
        residuals = [
            (e.measured - e.all_to_band(self.assembly.torque(e, theta)))[:, self.channels] for e in self.experiments
        ]
        counted = np.sum([e.counted[self.channels] for e in self.experiments], axis=0)
        return np.sqrt(np.sum(np.concatenate(residuals) ** 2, axis=0) / np.maximum(counted, 1))


def gather(blocks: Sequence[Block], channel: int) -> tuple[Index, Array]:
    """Parameters that a channel depends on (k,) and its derivative by them (n, k), one column for each."""
    own = [b for b in blocks if b.channel == channel and len(b.index)]
    if not own:
        return np.zeros(0, int), np.zeros((0, 0))
    index = np.concatenate([b.index for b in own])
    columns = np.concatenate([b.values for b in own], axis=1)
    unique, inverse = np.unique(index, return_inverse=True)
    if len(unique) == len(index):
        return index, columns
    return unique, columns @ np.eye(len(unique))[inverse]


def reached(assembly: TorqueModel, p: PlacedEffect) -> tuple[int, ...]:
    """Channels that a placed effect can change."""
    tree = assembly.tree
    if p.effect.at in PLACES:
        return reached_joints(cast(Rig, tree), p.effect.at, p.at, rows(p.effect))
    if p.effect.at == "base":
        return rows(p.effect)
    if p.effect.at == "link":
        return tuple(int(c) for c in np.flatnonzero(tree.moves[:, assembly.joint_of(p)]))
    if p.effect.acts_on == "position":
        return tuple(int(c) for c in tree.coupled(assembly.joint_of(p)))
    if p.effect.at != "joint":
        return (assembly.joint_of(p),)
    return tuple(int(c) for c in assembly.place_of(p).channels)


def split(assembly: TorqueModel, experiments: Sequence[Experiment], theta: Array) -> list[Problem]:
    """Cut a model's fit into problems that share no parameter; channels without any parameter are left out."""
    blocks = assembly.evaluate(experiments[0], theta).blocks
    label = np.arange(len(assembly.tree.joints))
    owner: dict[int, int] = {}
    for b in blocks:
        for i in b.index:
            label[label == label[b.channel]] = label[owner.setdefault(int(i), b.channel)]
    problems = []
    for value in dict.fromkeys(label[sorted(set(owner.values()))]):
        channels = np.flatnonzero(label == value)
        index = np.array(sorted(i for i, c in owner.items() if label[c] == value))
        part = assembly if len(index) == len(theta) else _part(assembly, channels, theta)
        problems.append(Problem(part, tuple(experiments), channels, index))
    return problems


def _part(assembly: TorqueModel, channels: Index, theta: Array) -> TorqueModel:
    """The model with only what reaches some channels."""
    placed = [p for p in assembly.placed if not set(reached(assembly, p)).isdisjoint(channels)]
    return assembly.keep(placed, theta)
