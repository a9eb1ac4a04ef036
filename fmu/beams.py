"""Elastic links in forward dynamics: the arm with virtual joints at their far ends, which springs hold.

Nothing is left out here: the turns are as large as they are, and couple as they do. The fit, `simulate` and an inverse
FMU have them to first order.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ..errors import InputError
from ..models.axes import place
from ..models.beam import TURNS, carried_joint, cut, length_axes
from ..models.floating.arm import FloatingArm
from ..models.hidden_state import rows
from ..models.model import Model, PlacedEffect
from ..models.tree import Tree
from .placed_laws import PlacedLaws


@dataclass(frozen=True)
class Turns:
    """One effect's virtual joints, by number among the arm's, and the axis of the beam that each turns about."""

    placed: PlacedEffect
    joints: tuple[int, ...]
    axes: tuple[int, ...]

    def spring(self, laws: PlacedLaws, q: ca.SX, qd: ca.SX) -> ca.SX:
        """Torque of the springs on the virtual joints at the arm's q, qd: what the law balances the moment with."""
        own = list(self.joints)
        behind = dict(zip(self.placed.effect.states, ca.vertsplit(-ca.vertcat(q[own], qd[own])), strict=True))
        found = laws.rate(self.placed, {**self._held(laws), **behind})
        return -found[len(own) :]

    def start(self, laws: PlacedLaws, load: ca.SX) -> ca.SX:
        """Angles of the virtual joints at which the springs carry the arm's load (J,)."""
        moment = ca.SX(TURNS, 1)
        for axis, joint in zip(self.axes, self.joints, strict=True):
            moment[axis] = load[joint]
        return -laws.steady(self.placed, {**self._held(laws), "moment": moment})[: len(self.joints)]

    def _held(self, laws: PlacedLaws) -> dict[str, ca.SX]:
        """Signals of a law without a moment, for an inertia of one: its acceleration is then the spring's torque."""
        return {**laws.signals(self.placed), "moment": ca.SX(TURNS, 1), "inertia_beyond": ca.vec(ca.SX.eye(TURNS))}


def with_turns(model: Model, arm: FloatingArm) -> tuple[FloatingArm, tuple[Turns, ...]]:
    """The arm with a virtual joint for every axis that a link of the model is elastic about.

    Raises
    ------
    InputError
        Where another effect acts along several joints at once, or a spring and the joint beyond it turn about one axis
        with no inertia between them.
    """
    elastic = [p for p in model.effects if p.effect.at == "beam"]
    if not elastic:
        return arm, ()
    for p in model.effects:
        if p.effect.at == "joint" and place(model.tree, p.at).alone is None:
            raise InputError(
                f"{model.path}: {p.key} acts along an axis, and {elastic[0].key} is a spring inside a link: their "
                "forward dynamics together are not written; export with --inverse"
            )
    tree, tip = arm.tree, arm.tree.links[arm.tip_link].name
    for link in reversed(range(tree.n_joints)):  # from the tip on, so that numbers before stay
        about = {axis for p in elastic if p.at == tree.links[link].name for axis in _axes(p)}
        if about:
            _demand_motor(model, tree, link, about)
            tree = cut(tree, link, tuple(sorted(about)))
    names = [link.name for link in tree.links]
    turns = []
    for p in elastic:
        link = names.index(p.at)
        about = sorted({axis for other in elastic if other.at == p.at for axis in _axes(other)})
        turns.append(Turns(p, tuple(link + 1 + about.index(axis) for axis in _axes(p)), _axes(p)))
    return replace(arm, tree=tree, tip_link=names.index(tip), as_published=True), tuple(turns)


def _demand_motor(model: Model, tree: Tree, link: int, about: set[int]) -> None:
    """InputError where the next joint turns about the springs' axes alone and its motor has no inertia."""
    joint = tree.joints[carried_joint(tree, link)]
    beside = [axis for axis in range(TURNS) if axis not in about]
    apart = length_axes(joint.translation).T[beside] @ joint.rotation @ joint.axis
    own = f"rotor_inertia.{joint.name}"
    if joint.kind == "revolute" and np.linalg.norm(apart) < 1e-6 and not model.values.get(f"{own}.inertia", 0) > 0:
        raise InputError(
            f"{model.path}: a spring in {tree.links[link].name} turns about the axis of {joint.name}, whose motor has "
            "no inertia, so the motion between them is not determined; add "
            f'{{ name = "rotor_inertia", at = "{joint.name}" }} to effects and a positive "{own}.inertia" to '
            "[parameters], or export with --inverse"
        )


def _axes(p: PlacedEffect) -> tuple[int, ...]:
    """Axes that a law turns the far end about."""
    return tuple(int(axis) for axis in np.unique(np.array(rows(p.effect)) % TURNS))
