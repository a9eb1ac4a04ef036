"""Torque of a model with its effects, and its derivative by every parameter, along recorded motion.

The torque of one joint's channel is built from the inside out:

    rigid body (links' inertial parameters, base parameters, link effects)
    + link displaced behind a flexible joint
    + joint effects (friction, drive train, harness)
    → sensor effects of the channel, in the order of the model.

Letters: n samples, J joints, P free parameters. A derivative is a list of blocks, one channel and a few parameters
each: friction of one joint never costs the other channels anything.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.axes import Place, place
from ...models.beam import carried_joint
from ...models.effect import Parameter, written_unit
from ...models.model import PlacedEffect
from ...models.tree import Tree
from .base_parameters import INERTIAL, BaseParameters
from .effect_kinds import effect_place
from .effect_places import EffectPlace, TorqueState
from .experiment import Experiment, Scales

Array = NDArray[np.float64]
Index = NDArray[np.int_]

KEPT = 3
"""Evaluations that stay with a recording: of the model as given, of the last fit, and of a trial beside them."""


@dataclass(frozen=True)
class FreeParameter:
    """One free parameter: what it belongs to, its unit, bounds and start."""

    effect: str
    at: str
    name: str
    unit: str
    low: float
    high: float
    start: float

    @property
    def key(self) -> str:
        """``effect.at.name``, as model files store it."""
        return f"{self.effect}.{self.at}.{self.name}"


@dataclass(frozen=True)
class Block:
    """Derivative of one channel by some parameters: ``values`` (n, k), for theta[index].

    ``key`` is set where the values never change, so that they are filtered into the analysis band only once.
    """

    channel: int
    index: NDArray[np.int_]
    values: Array
    key: object = None


@dataclass(frozen=True)
class TorqueEvaluation:
    """A model evaluated along one recording.

    ``load`` (n, J) is the rigid-body torque, ``tau`` (n, J) the modelled readings. ``passed`` has, for each channel
    with sensor effects, the map of torque columns to columns of the reading.
    """

    load: Array
    tau: Array
    blocks: list[Block]
    passed: dict[int, list[Callable[[Array], Array]]]


class TorqueModel:
    """Parameters of a model, in one order, and the torque they give.

    Parameters
    ----------
    tree : Tree
    placed : sequence of PlacedEffect
        Effects and where they act.
    base : BaseParameters or None
        Identified base inertial parameters; None trusts the tree's.
    scales : mapping of str to Scales
        Of every joint and axis, from the training recordings.
    values : mapping of str to float
        Known parameters by key, to start from.
    """

    def __init__(
        self,
        tree: Tree,
        placed: Sequence[PlacedEffect],
        base: BaseParameters | None,
        scales: Mapping[str, Scales],
        values: Mapping[str, float],
    ) -> None:
        """Lay out the parameters; raises InputError for a link effect beside identified inertia."""
        # What a link-side encoder does is no torque's business.
        placed = tuple(p for p in placed if not p.at.startswith("q_link."))
        self.tree, self.placed, self.base, self.scales = tree, placed, base, scales
        self._joints = [j.name for j in tree.joints]
        self._speeds = {at: values.get(f"speed_scale.{at}", s.speed) for at, s in scales.items()}
        self.phi = np.array(
            [
                values.get(f"inertia.{link.name}.{name}", value)
                for link in tree.links
                for name, value in zip(INERTIAL, link.phi, strict=True)
            ]
        )
        slots: list[FreeParameter] = []
        if base is not None:
            for (link, name, _), unit, value in zip(base.names, base.units, base.matrix @ self.phi, strict=True):
                slots.append(FreeParameter("inertia", link, name, unit, -np.inf, np.inf, float(value)))
        self._full: list[Array] = []
        self._free: list[NDArray[np.bool_]] = []
        self._index: list[NDArray[np.int_]] = []
        for p in placed:
            if base is not None and p.effect.at == "link":
                raise InputError(
                    f"effect {p.effect.name} at {p.at} with inertia = 'free': the identified inertia already holds it; "
                    f"use inertia = 'fixed', or leave the effect out"
                )
            free = np.array([x.name not in p.hold for x in p.effect.parameters])
            full = np.array([values.get(f"{p.key}.{x.name}", self.usual(p, x)) for x in p.effect.parameters])
            self._index.append(len(slots) + np.arange(np.count_nonzero(free)))
            for x, start, is_free in zip(p.effect.parameters, full, free, strict=True):
                if is_free:
                    low, high = self.bounds(p, x)
                    unit = self.unit(p, x)
                    slots.append(
                        FreeParameter(p.effect.name, p.at, x.name, unit, low, high, float(np.clip(start, low, high)))
                    )
            self._full.append(full)
            self._free.append(free)
        self.slots = tuple(slots)
        self.start = np.array([s.start for s in slots], float)
        self.low = np.array([s.low for s in slots], float)
        self.high = np.array([s.high for s in slots], float)

    def at(self, p: PlacedEffect) -> EffectPlace:
        """The place where an effect acts; it gives the effect's terms of the torque.

        The late encoder of a single joint makes its channel early, whatever the joint's inertia. Among other joints it
        also changes their torques, by the tree's inertia.
        """
        early_alone = len(self._joints) == 1 and self.base is not None
        return effect_place(self.tree, p, self.joint_of(p), self.speed_scale(p), early_alone)

    def joint_of(self, p: PlacedEffect) -> int:
        """Index of the joint that an effect's place belongs to; of an axis, the first of its joints."""
        link = self.tree.link_at(p.effect.at, p.at)
        return int(self.place_of(p).channels[0]) if link is None else link

    def place_of(self, p: PlacedEffect) -> Place:
        """The joint, or the axis, that an effect acts at, or whose channel it reads."""
        return place(self.tree, p.at.removeprefix("tau.").removeprefix("q."))

    def _own(self, p: PlacedEffect) -> str:
        """Name of the joint or axis whose scales an effect refers to; a beam's is the joint that it carries."""
        if p.effect.at == "beam":
            return self._joints[carried_joint(self.tree, self.joint_of(p))]
        return p.at if p.at in self.scales else self._joints[self.joint_of(p)]

    def speed_scale(self, p: PlacedEffect) -> float:
        """Peak speed that an effect's law refers to [rad/s or m/s]."""
        return self._speeds[self._own(p)]

    def scale(self, p: PlacedEffect, parameter: Parameter) -> float:
        """Unit of a parameter's bounds and grid at this place."""
        return self.scales[self._own(p)].of(parameter.relative_to)

    def origin(self, p: PlacedEffect, parameter: Parameter) -> float:
        """Where a parameter's bounds and grid are counted from at this place."""
        return self.scales[self._own(p)].origin(parameter.relative_to)

    def bounds(self, p: PlacedEffect, parameter: Parameter) -> tuple[float, float]:
        """Physical bounds of a parameter at a place."""
        scale, origin = self.scale(p, parameter), self.origin(p, parameter)
        return origin + parameter.low * scale, origin + parameter.high * scale

    def unit(self, p: PlacedEffect, parameter: Parameter) -> str:
        """A parameter's unit with the joint's torque and position units written out."""
        return written_unit(parameter.unit, self.tree.joints[self.joint_of(p)].kind, p.at)

    def usual(self, p: PlacedEffect, parameter: Parameter) -> float:
        """Start of a parameter: middle of its grid, or the value at which the effect vanishes."""
        share = parameter.grid[len(parameter.grid) // 2] if parameter.grid else parameter.zero
        return self.origin(p, parameter) + share * self.scale(p, parameter)

    def values(self, theta: Array) -> dict[str, float]:
        """Every effect parameter by key, and the speed scales that laws refer to, as a model file stores them."""
        speeds = {f"speed_scale.{at}": float(v) for at, v in self._speeds.items()}
        return speeds | {
            f"{p.key}.{x.name}": float(value)
            for k, p in enumerate(self.placed)
            for x, value in zip(p.effect.parameters, self.parameters(k, theta), strict=True)
        }

    def keep(self, placed: Sequence[PlacedEffect], theta: Array) -> "TorqueModel":
        """This model with only some of its effects, started from its values."""
        kept = TorqueModel(self.tree, placed, self.base, self.scales, self.values(theta))
        kept.phi = self.phi
        return kept

    def parameters(self, k: int, theta: Array) -> Array:
        """All parameters of the k-th placed effect, in its law's order."""
        full = self._full[k].copy()
        full[self._free[k]] = theta[self._index[k]]
        return full

    def index_of(self, p: PlacedEffect) -> NDArray[np.int_]:
        """Positions in theta of a placed effect's free parameters."""
        return self._index[[x.key for x in self.placed].index(p.key)]

    def torque(self, experiment: Experiment, theta: Array) -> Array:
        """Modelled reading of every torque channel (n, J) [N·m or N]."""
        return self.evaluate(experiment, theta).tau

    def residual(self, experiment: Experiment, theta: Array) -> tuple[Array, list[Block]]:
        """Measured minus modelled torque in the analysis band (n_band, J), and the model's derivative blocks there."""
        state = self.evaluate(experiment, theta)
        banded = []
        for block in state.blocks:
            columns = None if block.key is None else experiment.store.get(block.key)
            if columns is None:
                columns = experiment.to_band(block.values, block.channel)
                if block.key is not None:
                    experiment.store[block.key] = columns
            banded.append(Block(block.channel, block.index, columns))
        return experiment.measured - experiment.all_to_band(state.tau), banded

    def evaluate(self, experiment: Experiment, theta: Array) -> TorqueEvaluation:
        """Rigid-body torque, readings and derivative blocks at full rate; the last few are kept with the recording."""
        kept: list[tuple[TorqueModel, bytes, TorqueEvaluation]] = experiment.store.setdefault("evaluated", [])
        key = theta.tobytes() + self.phi.tobytes()
        for other, at, found in kept:
            if other is self and at == key:
                return found
        found = self._evaluate(experiment, theta)
        kept.append((self, key, found))
        del kept[:-KEPT]
        return found

    def _evaluate(self, experiment: Experiment, theta: Array) -> TorqueEvaluation:
        load, rigid = self._rigid(experiment, theta)
        tau, blocks = load.copy("F"), list(rigid)
        passed: dict[int, list[Callable[[Array], Array]]] = {}
        # Sensors read what all the others add up to, so they come last.
        for k, p in sorted(enumerate(self.placed), key=lambda item: item[1].effect.at == "sensor"):
            if p.effect.at == "link":
                continue
            here = self.at(p)
            terms, by_load, sense = here.terms(TorqueState(experiment, load, tau), self.parameters(k, theta))
            if sense is not None:
                j = here.joint
                passed.setdefault(j, []).append(sense)
                apart = len(rigid) if here.apart else 0
                blocks[apart:] = _sensed(blocks[apart:], j, sense)
            if by_load is not None:
                blocks += self._through_load(p, by_load, rigid)
            for channel, values, columns in terms:
                tau[:, channel] += values
                if not self._free[k].any():
                    continue  # all of it is held
                blocks.append(Block(channel, self._index[k], columns[:, self._free[k]]))
        return TorqueEvaluation(load, tau, blocks, passed)

    def _through_load(self, p: PlacedEffect, by_load: Array, rigid: Sequence[Block]) -> list[Block]:
        """Derivative blocks of a torque that follows the load of its place: by_load (n,), of what gives the load."""
        here = self.place_of(p)
        return [
            Block(int(c), b.index, (here.along[c] * here.back[b.channel]) * by_load[:, None] * b.values)
            for c in here.channels
            for b in rigid
            if here.back[b.channel]
        ]

    def _rigid(self, experiment: Experiment, theta: Array) -> tuple[Array, list[Block]]:
        """Rigid-body torque (n, J) and its derivative blocks."""
        n_joints = len(self._joints)
        if self.base is not None:
            key = ("base", self.base.columns.tobytes())
            if key not in experiment.store:
                experiment.store[key] = [_kept(*experiment.regressor.of(c), self.base) for c in range(n_joints)]
            blocks = [Block(c, at, own, ("base", c)) for c, (at, own) in enumerate(experiment.store[key])]
            return np.stack([b.values @ theta[b.index] for b in blocks], 1) - experiment.carried, blocks
        key = ("rigid", self.phi.tobytes())
        if key not in experiment.store:
            motion = experiment.motion
            torque = experiment.body.torque(motion.q, motion.qd, motion.qdd, self.phi)
            experiment.store[key] = np.asfortranarray(torque - experiment.carried)
        load, blocks = experiment.store[key].copy("F"), []  # a joint's samples side by side
        for k, p in enumerate(self.placed):
            if p.effect.at != "link":
                continue
            terms = self.at(p).terms(TorqueState(experiment, load, load), self.parameters(k, theta)).terms
            for channel, values, columns in terms:
                load[:, channel] += values
                blocks.append(Block(channel, self._index[k], columns[:, self._free[k]]))
        return load, blocks


def _kept(felt: Index, columns: Array, base: BaseParameters) -> tuple[Index, Array]:
    """Base parameters that a joint feels (k,), and its torque by them (n, k)."""
    known = np.isin(felt, base.columns)
    return np.searchsorted(base.columns, felt[known]), np.ascontiguousarray(columns[:, known])


def _sensed(blocks: Sequence[Block], channel: int, sense: Callable[[Array], Array]) -> list[Block]:
    """Blocks with a channel's as its sensor reads them, all columns in one pass."""
    own = [b for b in blocks if b.channel == channel]
    if not own:
        return list(blocks)
    stops = np.cumsum([b.values.shape[1] for b in own])[:-1]
    read = iter(np.split(sense(np.concatenate([b.values for b in own], axis=1)), stops, axis=1))
    return [Block(channel, b.index, next(read)) if b.channel == channel else b for b in blocks]
