"""A free-floating arm as a tree that recordings can be fitted to: six carriers of the base, then the arm's joints."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..inertia import Array
from ..tree import Link, Tree
from ..urdf import load_urdf
from .arm import FloatingArm, load_arm
from .ets_vii import ets_vii

if TYPE_CHECKING:
    from ..regressor import Regressor
    from ..rigid_body import RigidBody

CARRIERS = 6
"""Leading joints that carry the base; their torques are the force and the moment on it, in its own axes."""

UNNAMED = "base"
"""What the base is called where the model file does not say."""


@dataclass(frozen=True, eq=False)
class FloatingTree(Tree):
    """`FloatingArm.whole`: joints 0 to 5 carry the base, link 5 is the base.

    ``body`` is the base's name in recordings (``quat.<body>.w`` and so on).
    """

    body: str = UNNAMED

    @property
    def stands(self) -> bool:
        """Every joint moves the base."""
        return False

    def sticks(self, joint: int) -> bool:
        """Nothing holds the base."""
        return joint >= CARRIERS

    @property
    def carriers(self) -> int:
        """Those of the base."""
        return CARRIERS

    def carried(
        self, body: "RigidBody", q: Array, regressor: Callable[[], "Regressor"], tension: Mapping[str, Array]
    ) -> Array:
        """Force and moment that the base's own momentum asks for, which its channels have as measured."""
        own = np.zeros_like(q)
        for c, columns in regressor().of_link(CARRIERS - 1):
            own[:, c] = columns @ self.links[CARRIERS - 1].phi
        return own


def floating_tree(arm: FloatingArm, body: str = UNNAMED) -> FloatingTree:
    """Base and arm as one tree."""
    whole = arm.whole
    return FloatingTree(whole.name, whole.joints, whole.links, whole.gravity, body)


def arm_on(tree: FloatingTree, phi: Array) -> FloatingArm:
    """Base and arm apart again, with inertial parameters (10 L,) of all links; unchecked, tip at the last link."""
    names = [link.name for link in tree.links]
    links = [Link(name, own) for name, own in zip(names, phi.reshape(-1, 10), strict=True)]
    joints = tuple(replace(joint, parent=joint.parent - CARRIERS) for joint in tree.joints[CARRIERS:])
    # A joint on the base hangs from the last carrier: its parent is then -1, the base.
    arm = Tree(tree.name, joints, tuple(links[CARRIERS:]), tree.gravity)
    return FloatingArm(arm, links[CARRIERS - 1].phi, len(joints) - 1, as_published=True)


def read_floating(urdf: Path | None, gravity: tuple[float, ...], body: str) -> FloatingTree:
    """A URDF whose root link floats, or the built-in ETS-VII where there is none.

    Raises
    ------
    InputError
        As `load_arm` does, for gravity too: nothing would hold the base.
    """
    if urdf is None:
        built_in = ets_vii()
        arm = FloatingArm(
            Tree(built_in.tree.name, built_in.tree.joints, built_in.tree.links, np.array(gravity, float)),
            built_in.base,
            built_in.tip_link,
            as_published=True,
        )
    else:
        arm = load_arm(urdf, load_urdf(urdf, gravity).links[-1].name, gravity=gravity)
    return floating_tree(arm, body)


def channel(tree: Tree, index: int) -> str:
    """Name of a torque channel: ``tau.<joint>``, or ``force.<base>.x`` to ``torque.<base>.z`` for a floating base."""
    if isinstance(tree, FloatingTree) and index < CARRIERS:
        return f"{'force' if index < 3 else 'torque'}.{tree.body}.{'xyz'[index % 3]}"
    return f"tau.{tree.joints[index].name}"
