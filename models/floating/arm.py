"""An arm on a base that floats or stands still: bodies, joints and the point that the arm works with.

The base's frame is fixed in the base; its inertial parameters are about that frame. The arm is a `Tree` that takes the
base's frame for its world. A floating base adds six degrees of freedom, its twist.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from .. import urdf
from ..inertia import Array, is_physical, nearest_physical, to_central, transform
from ..tree import Joint, Link, Tree

BASE_JOINTS = ("base.x", "base.y", "base.z", "base.roll", "base.pitch", "base.yaw")


@dataclass(frozen=True, eq=False)
class FloatingArm:
    """A base, the arm on it and its tip.

    Parameters
    ----------
    tree : Tree
        The arm; a joint of parent -1 sits on the base. ``tree.gravity`` is in the world frame [m/s²].
    base : array (10,)
        Inertial parameters phi of the base about its frame.
    tip_link : int
        Index of the link that carries the tip.
    tip_rotation, tip_translation : array (3, 3), (3,)
        Pose of the tip's frame in that link's frame [–, m].
    floating : bool
        False: the base stands still in the world.
    as_published : bool
        True keeps an inertia that no body can have, if a publication gives one; `projected` mends it.
    mount : pair of arrays (3, 3), (3,), or None
        Rotation and translation in the base's frame of a frame that is fixed there, where something else pulls at the
        base [–, m].

    Raises
    ------
    InputError
        Where a floating base has gravity and nothing to hold it, an inertia is not physical, or the tip's link is not
        one of the arm's.
    """

    tree: Tree
    base: Array
    tip_link: int
    tip_rotation: Array = field(default_factory=lambda: np.eye(3))
    tip_translation: Array = field(default_factory=lambda: np.zeros(3))
    floating: bool = True
    as_published: bool = False
    mount: tuple[Array, Array] | None = None

    def __post_init__(self) -> None:
        """Refuse what would fall, or what no body is."""
        name, gravity = self.tree.name, self.tree.gravity
        if self.tree.followers:
            follower = self.tree.followers[0]
            leader = self.tree.joints[follower.leader].name
            raise InputError(
                f"{name}: joint '{follower.joint.name}' mimics '{leader}', and neither a floating arm nor an export "
                "has equations for that; make both fixed in a copy of the URDF"
            )
        if not 0 <= self.tip_link < self.n_joints:
            raise InputError(f"{name}: tip_link is {self.tip_link}; give 0 to {self.n_joints - 1}")
        if self.floating and np.any(gravity):
            raise InputError(
                f"{name}: a floating base with gravity {gravity.tolist()} m/s² and nothing to hold it would fall; "
                "set gravity to [0.0, 0.0, 0.0], or let the base be fixed"
            )
        if self.floating and not self.base[0] > 0:
            raise InputError(f"{name}: the floating base has a mass of {self.base[0]:g} kg; give it one above 0")
        if self.as_published:
            return
        for body, phi in (("the base", self.base), *((f"link '{k.name}'", k.phi) for k in self.tree.links)):
            if not is_physical(phi):
                moments = ", ".join(f"{m:.6g}" for m in np.linalg.eigvalsh(to_central(phi)[2]))
                raise InputError(
                    f"{name}: {body} has an inertia that no body can have: mass {phi[0]:.6g} kg, principal moments "
                    f"{moments} kg·m²; correct it, take `nearest_physical` of models/inertia.py, or pass "
                    "as_published=True to keep it"
                )

    @property
    def n_joints(self) -> int:
        """Number of the arm's joints J."""
        return self.tree.n_joints

    @property
    def whole(self) -> Tree:
        """Base and arm as one tree of 6 + J joints whose first six carry the base (`BASE_JOINTS`), all at zero.

        Its world is the inertial frame that coincides with the base's frame at this instant: with the six positions at
        zero their rates are the base's twist, and the six torques are the force and moment on it.
        """
        eye, zero, none = np.eye(3), np.zeros(3), np.zeros(10)
        carriers = [
            Joint(name, "prismatic" if i < 3 else "revolute", eye[i % 3], i - 1, eye, zero)
            for i, name in enumerate(BASE_JOINTS)
        ]
        links = [Link(name, none) for name in BASE_JOINTS[:-1]] + [Link("base", self.base)]
        joints = [replace(joint, parent=joint.parent + 6) for joint in self.tree.joints]
        return Tree(self.tree.name, (*carriers, *joints), (*links, *self.tree.links), self.tree.gravity)

    def unphysical(self) -> tuple[str, ...]:
        """Names of the links whose inertia no body can have."""
        return tuple(link.name for link in self.tree.links if not is_physical(link.phi))

    def projected(self) -> "FloatingArm":
        """This arm with every impossible inertia replaced by the nearest that a body can have (`nearest_physical`)."""
        links = tuple(Link(k.name, k.phi if is_physical(k.phi) else _nearest(k.phi)) for k in self.tree.links)
        base = self.base if is_physical(self.base) else _nearest(self.base)
        return replace(self, tree=replace(self.tree, links=links), base=base, as_published=False)


def load_arm(path: str | Path, tip: str, floating: bool = True, gravity: ArrayLike = (0.0, 0.0, 0.0)) -> FloatingArm:
    """Read a URDF as an arm on its root link, which is the base.

    Parameters
    ----------
    path : str or Path
    tip : str
        Name of the link whose frame is the tip.
    floating : bool
        Whether the root link floats or stands still.
    gravity : array (3,)
        In the world frame [m/s²]; none for a floating base.

    Raises
    ------
    InputError
        As `load_urdf` and `FloatingArm` do; where no link is named so, or it does not move with a joint.
    """
    path = Path(path)
    tree = urdf.load_urdf(path, gravity)
    if tree.weightless:
        raise InputError(f"{path}: joint '{tree.weightless[0]}' moves no mass; give a link beyond it an <inertial>")
    robot = urdf.read_robot(path)
    root = urdf.checked_root(path, robot)
    parameters = {link.get("name", ""): urdf.link_parameters(path, link) for link in robot.findall("link")}
    base, places = parameters[root], {}
    moving = 0
    for joint, carrier, rotation, translation in urdf.walk(urdf.parse_plant(path, robot, root), root):
        child = joint.child_body().name()
        if joint.type_name() == "weld":
            places[child] = (carrier, rotation, translation)
            base = base + transform(parameters[child], rotation, translation) if carrier < 0 else base
        else:
            places[child], moving = (moving, np.eye(3), np.zeros(3)), moving + 1
    movable = [name for name, place in places.items() if place[0] >= 0]
    if tip not in movable:
        raise InputError(f"{path}: tip is '{tip}'; name a link that a joint moves: {', '.join(movable)}")
    return FloatingArm(tree, base, *places[tip], floating=floating)


def _nearest(phi: Array) -> Array:
    return nearest_physical(*to_central(phi))
