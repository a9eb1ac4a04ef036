"""What is believed of a system: its tree, the effects it has, and where each of them acts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from ..errors import InputError
from ..recordings.cuts import Cuts
from ..recordings.signals import Signal
from .axes import neighbours
from .beam import beams
from .docking.bench_setup import DockingTree, docking_places
from .effect import Effect
from .hidden_state import rows
from .holding import Holding
from .rig.kinematics import places_of, reached_joints
from .rig.rig import Rig
from .servo import Servo
from .snare.setup import SnareTree, snare_places
from .transmission import Transmission
from .tree import Tree

OfTree = TypeVar("OfTree", bound=Tree)


@dataclass(frozen=True)
class PlacedEffect:
    """An effect and the one place it acts at: a joint, an axis, a link, a sling, or a channel such as ``tau.joint1``.

    Parameters named in ``hold`` are not identified: the recordings do not determine them, or another effect has
    them.
    """

    effect: Effect
    at: str
    hold: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """``effect.at``, by which parameters are stored."""
        return f"{self.effect.name}.{self.at}"


@dataclass(frozen=True)
class Model:
    """A model file, read and checked.

    Parameters
    ----------
    path : Path
        The file.
    name, system : str
    urdf : Path or None
        None for the built-in rig, the built-in ETS-VII, and a snare.
    tree : Tree
        Joints, links, nominal inertia and gravity; a `Rig` for ``zero_g_rig``, with its slings; a `FloatingTree` for
        ``free_floating_arm``, whose first six joints carry the base; a `SnareTree` without joints for
        ``snare_capture``, a `DockingTree` for ``docking``.
    inertia : "fixed" or "free"
    effects : tuple of PlacedEffect
        Physics that the model has, one entry a place.
    signals : mapping of str to Signal
        Where a recording with other column names has each signal.
    bandwidth : float or None
        Edge of the analysis band [Hz]; None: chosen from the recordings.
    values : mapping of str to float
        Parameters known so far, by ``effect.at.parameter`` (``inertia.<link>.<parameter>`` for inertial parameters).
    holding : Holding
        Joints of the robot's file that are held, and what is done about physically impossible inertias.
    cuts : Cuts
        Samples of the recordings that are left out.
    servo : mapping of str to Servo
        Joints whose torque is computed from their servo's commanded position.
    transmission : Transmission or None
        Motors that move several joints.
    """

    path: Path
    name: str
    system: str
    urdf: Path | None
    tree: Tree
    inertia: str
    effects: tuple[PlacedEffect, ...]
    signals: Mapping[str, Signal]
    bandwidth: float | None
    values: Mapping[str, float]
    holding: Holding = field(default_factory=Holding)
    cuts: Cuts = field(default_factory=Cuts)
    servo: Mapping[str, Servo] = field(default_factory=dict)
    transmission: Transmission | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names in order."""
        return tuple(j.name for j in self.tree.joints)

    def with_effects(self, added: Sequence[PlacedEffect], values: Mapping[str, float]) -> "Model":
        """The model with more effects, and with a fit's parameters."""
        return replace(self, effects=(*self.effects, *added), values={**self.values, **values})

    def tree_as(self, kind: type[OfTree]) -> OfTree:
        """The tree, one of a kind; raises InputError where the model is of another system."""
        if not isinstance(self.tree, kind):
            raise InputError(f"{self.path}: system = {self.system!r} has no {kind.__name__}; give a model that has one")
        return self.tree

    def demand_values(self, *more: str) -> None:
        """Raise InputError where a parameter of the effects, or one of ``more``, has no value."""
        wanted = [*more, *(f"{p.key}.{x.name}" for p in self.effects for x in p.effect.parameters)]
        missing = [key for key in wanted if key not in self.values]
        if missing:
            raise InputError(
                f"{self.path}: no value for {missing[0]!r} ({len(missing)} missing); write it under [parameters], "
                "or let 'snarelab identify --save-model' do it"
            )


def places(effect: Effect, tree: Tree) -> tuple[str, ...]:
    """Places of a tree at which an effect can act on some torque; sensor effects act on torque channels by default."""
    if isinstance(tree, SnareTree):
        return snare_places(effect.name, tree)
    if isinstance(tree, DockingTree):
        return docking_places(effect.at)
    carriers = tree.carriers
    if effect.neighbours == "only":
        return tuple(axis.name for axis in neighbours(tree, carriers))
    if effect.at == "joint":
        return tuple(j.name for j in tree.joints[carriers:])
    if effect.at == "link":
        return tuple(link.name for link in tree.links[max(carriers - 1, 0) : tree.n_joints])
    if effect.at == "beam":
        return beams(tree)
    if effect.at == "base":
        return ("base",) if carriers else ()
    if effect.at != "sensor":
        if not isinstance(tree, Rig):
            return ()
        every = places_of(tree, effect.at)
        return tuple(at for at in every if reached_joints(tree, effect.at, at, rows(effect)))
    return tuple(f"tau.{j.name}" for j in tree.joints[carriers:])


def effect_on(effect: Effect, tree: Tree) -> Effect:
    """The law that an effect's name stands for on a tree: its own, or the one for a tree without such places."""
    return effect if effect.elsewhere is None or places(effect, tree) else effect.elsewhere


def all_places(effect: Effect, tree: Tree) -> tuple[str, ...]:
    """`places`, and axes of several joints: there an effect acts only if the model file names the axis."""
    own = places(effect, tree)
    if effect.at != "joint" or effect.acts_on != "torque" or tree.simulated_as:
        return own
    unasked = neighbours(tree, tree.carriers) if effect.neighbours == "too" else ()
    stated = [axis for axis in tree.axes if len(axis.along) > 1]
    same = [axis.along for axis in stated]
    return (*own, *(axis.name for axis in (*stated, *(axis for axis in unasked if axis.along not in same))))
