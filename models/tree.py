"""A tree of rigid bodies on a fixed base: joints in order, and one moving link behind each.

Frames: joint i's frame sits at a fixed pose on the parent link; the link behind it has the same frame when the joint is
at zero, turned about (revolute) or moved along (prismatic) ``axis`` otherwise. The base is the world frame.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .axes import JointAxis
from .inertia import Array

if TYPE_CHECKING:
    from .regressor import Regressor
    from .rigid_body import RigidBody


@dataclass(frozen=True, eq=False)
class Joint:
    """One degree of freedom.

    Parameters
    ----------
    name : str
    kind : "revolute" or "prismatic"
    axis : array (3,)
        Unit vector in the joint's frame.
    parent : int
        Index of the joint (and link) that carries it; -1 for the base.
    rotation, translation : array (3, 3), (3,)
        Fixed pose of the joint's frame in the parent link's frame [–, m].
    lower, upper : float
        Position limits [rad or m]; infinite where there are none.
    speed : float
        Velocity limit [rad/s or m/s].
    effort : float
        Limit of torque or force [N·m or N]; infinite where there is none.
    """

    name: str
    kind: Literal["revolute", "prismatic"]
    axis: Array
    parent: int
    rotation: Array
    translation: Array
    lower: float = float("-inf")
    upper: float = float("inf")
    speed: float = float("inf")
    effort: float = float("inf")


@dataclass(frozen=True, eq=False)
class Follower:
    """A joint without a freedom of its own (URDF's ``mimic``): it stands at ``multiplier * q[leader] + offset``.

    ``joint.parent`` counts links: joints' links first, then followers'. What moves with it is felt at the leader.
    """

    joint: Joint
    leader: int
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False)
class Link:
    """The moving body behind a joint, with everything welded to it: name and inertial parameters phi (10,)."""

    name: str
    phi: Array


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints and links of a fixed-base tree; ``links[i]`` is moved by ``joints[i]``, parents stand before children.

    Behind the joints' links stand those of the ``followers``, in their order. ``notes`` are what a reader of the
    robot's file did that a user should know, ``weightless`` the joints that are held because they move no mass,
    ``axes`` places for effects along combinations of joints.

    Raises
    ------
    InputError
        Where there is no joint, links and joints differ in number, a parent stands after its child, or an axis is not
        a unit vector.
    """

    name: str
    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    gravity: Array
    followers: tuple[Follower, ...] = field(default=(), kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    weightless: tuple[str, ...] = field(default=(), kw_only=True)
    axes: tuple[JointAxis, ...] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        """Refuse what the recursions could not run through."""
        moving = (*self.joints, *(f.joint for f in self.followers))
        if not self.joints or len(moving) != len(self.links):
            raise InputError(
                f"{self.name}: {len(moving)} joints and {len(self.links)} links; "
                "give one link per joint, and at least one"
            )
        for index, joint in enumerate(moving):
            if not -1 <= joint.parent < index:
                raise InputError(
                    f"{self.name}: joint '{joint.name}' is number {index} and has parent {joint.parent}; "
                    f"allowed are -1 to {index - 1}: order parents before children"
                )
            if abs(np.linalg.norm(joint.axis) - 1.0) > 1e-9:
                raise InputError(f"{self.name}: joint '{joint.name}' has axis {joint.axis}; give it length 1")

    @property
    def n_joints(self) -> int:
        """Number of joints J: degrees of freedom, so without followers."""
        return len(self.joints)

    @property
    def stands(self) -> bool:
        """Whether it stands on ground that no joint moves: a joint at rest feels nothing of the others there."""
        return True

    def sticks(self, joint: int) -> bool:
        """Whether dry friction can hold a joint where it is."""
        return self.stands

    @property
    def carriers(self) -> int:
        """Number of leading joints that are no joints of the arm: 6 where they carry a floating base."""
        return 0

    @property
    def simulated_as(self) -> str:
        """Kind of recording that only a simulation of everything predicts; "" where a motion gives the torques."""
        return ""

    @property
    def balanced(self) -> bool:
        """Whether its weight is taken wherever it stands, by what moves with it."""
        return False

    @property
    def tensions(self) -> tuple[str, ...]:
        """Names of what holds it up, whose tension a recording may have as ``tension.<name>``."""
        return ()

    def link_at(self, kind: str, name: str) -> int | None:
        """Index of the link that a place of a kind belongs to, by the place's name; None for a joint or an axis."""
        if kind not in ("link", "boom", "beam", "base"):
            return None
        return [link.name for link in self.links].index(name)

    def carried(
        self, body: "RigidBody", q: Array, regressor: Callable[[], "Regressor"], tension: Mapping[str, Array]
    ) -> Array:
        """Torque that something else than the joints' drives supplies (n, J) [N·m or N].

        ``q`` (n, J), what gives the ``regressor`` at the motion, measured ``tension`` (n,) [N] by name.
        """
        return np.zeros_like(q)

    @property
    def bodies(self) -> tuple[tuple[Joint, int, float, float], ...]:
        """Of every link: what moves it, and by which freedom: (joint, index, multiplier, offset), parents first."""
        own = [(joint, i, 1.0, 0.0) for i, joint in enumerate(self.joints)]
        return (*own, *((f.joint, f.leader, f.multiplier, f.offset) for f in self.followers))

    @cached_property
    def moves(self) -> NDArray[np.bool_]:
        """Whether a joint moves a link (J, L), as leader of its followers too: only then does it feel its inertia."""
        found = np.zeros((self.n_joints, len(self.links)), bool)
        for link, (joint, own, _, _) in enumerate(self.bodies):
            if joint.parent >= 0:
                found[:, link] = found[:, joint.parent]
            found[own, link] = True
        return found

    def coupled(self, joint: int) -> NDArray[np.int_]:
        """Joints that feel how a joint moves, itself among them: a link is moved by both."""
        return np.flatnonzero((self.moves & self.moves[joint]).any(axis=1))

    @property
    def phi(self) -> Array:
        """Inertial parameters of all links, one after the other, shape (10 * L,)."""
        return np.concatenate([link.phi for link in self.links])
