"""Random serial arms, written both as URDF and as MJCF, so that two engines can be given the same robot."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

STANDARD_GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True, eq=False)
class Link:
    """One joint and the link behind it; the link's frame is the joint's frame.

    Parameters
    ----------
    kind : "revolute" or "prismatic"
    origin, rpy : arrays of shape (3,)
        Frame in the parent link's: position [m] and roll, pitch, yaw about fixed axes [rad] (URDF's convention).
    axis : array of shape (3,)
        Joint axis in the link's frame.
    mass : float
        [kg]
    com : array of shape (3,)
        Centre of mass in the link's frame [m].
    inertia : array of shape (3, 3)
        About the centre of mass, in the link's axes [kg·m²].
    travel, speed : float
        Limits of ``|q|`` and ``|qd|`` [rad or m, and per s].
    """

    kind: str
    origin: NDArray
    rpy: NDArray
    axis: NDArray
    mass: float
    com: NDArray
    inertia: NDArray
    travel: float
    speed: float


@dataclass(frozen=True, eq=False)
class Arm:
    """A fixed-base serial arm: joints ``joint1``..., links ``link1``..., from base to tip."""

    links: tuple[Link, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names, base to tip."""
        return tuple(f"joint{k}" for k in range(1, len(self.links) + 1))

    def with_payload(self, mass: float, point: ArrayLike) -> "Arm":
        """Fix a point mass [kg] to the last link at ``point`` [m, link frame]."""
        last, point = self.links[-1], np.asarray(point, float)
        total = last.mass + mass
        com = (last.mass * last.com + mass * point) / total
        inertia = last.inertia + _point_inertia(last.mass, last.com - com) + _point_inertia(mass, point - com)
        return Arm((*self.links[:-1], replace(last, mass=total, com=com, inertia=inertia)))

    def with_com_offset(self, link: str, offset: ArrayLike) -> "Arm":
        """Shift a link's centre of mass by ``offset`` [m, link frame]; its inertia about it stays."""
        k = int(link.removeprefix("link")) - 1
        moved = replace(self.links[k], com=self.links[k].com + np.asarray(offset, float))
        return Arm((*self.links[:k], moved, *self.links[k + 1 :]))

    def urdf(self, name: str = "arm") -> str:
        """The arm as URDF text; the base link is ``base``."""
        parts = [f'<robot name="{name}">', '  <link name="base"/>']
        for k, link in enumerate(self.links, 1):
            i = link.inertia
            parts += [
                f'  <link name="link{k}">',
                "    <inertial>",
                f'      <origin xyz="{_text(link.com)}" rpy="0 0 0"/>',
                f'      <mass value="{link.mass!r}"/>',
                f'      <inertia ixx="{i[0, 0]:.17g}" ixy="{i[0, 1]:.17g}" ixz="{i[0, 2]:.17g}"'
                f' iyy="{i[1, 1]:.17g}" iyz="{i[1, 2]:.17g}" izz="{i[2, 2]:.17g}"/>',
                "    </inertial>",
                "  </link>",
                f'  <joint name="joint{k}" type="{link.kind}">',
                f'    <parent link="{"base" if k == 1 else f"link{k - 1}"}"/>',
                f'    <child link="link{k}"/>',
                f'    <origin xyz="{_text(link.origin)}" rpy="{_text(link.rpy)}"/>',
                f'    <axis xyz="{_text(link.axis)}"/>',
                f'    <limit lower="{-link.travel:.17g}" upper="{link.travel:.17g}" velocity="{link.speed:.17g}"'
                ' effort="1000"/>',
                "  </joint>",
            ]
        return "\n".join([*parts, "</robot>", ""])

    def mjcf(
        self,
        *,
        timestep: float = 2.5e-4,
        gravity: ArrayLike = STANDARD_GRAVITY,
        attributes: Mapping[str, str] | None = None,
        twist: Mapping[str, str] | None = None,
        turns: Mapping[str, Mapping[int, str]] | None = None,
    ) -> str:
        """The arm as MJCF text.

        ``attributes`` adds text to a joint's element. ``twist`` splits a joint in two about one axis, a massless motor
        body and the link behind it, and gives the text of the joint between them, named ``<joint>_twist``. ``turns``
        puts hinges at a link's far end, where the next joint sits, named ``<link>_turn<k>``: about its length (0) and
        two axes across it (1, 2), each with its text.
        """
        attributes, twist, turns = attributes or {}, twist or {}, turns or {}
        opened, bodies = 0, []
        for k, (joint, link) in enumerate(zip(self.joints, self.links, strict=True), 1):
            kind = {"revolute": "hinge", "prismatic": "slide"}[link.kind]
            place = f'pos="{_text(link.origin)}" euler="{_text(link.rpy)}"'
            if hinges := turns.get(f"link{k - 1}"):
                axes = length_axes(link.origin)
                bodies += [
                    f'<body name="end{k - 1}" pos="{_text(link.origin)}">',
                    '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>',
                    *(
                        f'<joint name="link{k - 1}_turn{a}" type="hinge" axis="{_text(axes[a])}" {own}/>'
                        for a, own in hinges.items()
                    ),
                ]
                opened += 1
                place = f'euler="{_text(link.rpy)}"'
            moves = f'type="{kind}" axis="{_text(link.axis)}"'
            if joint in twist:
                bodies += [
                    f'<body name="motor{k}" {place}>',
                    '<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>',
                    f'<joint name="{joint}" {moves} {attributes.get(joint, "")}/>',
                    f'<body name="link{k}">',
                    f'<joint name="{joint}_twist" {moves} {twist[joint]}/>',
                ]
            else:
                bodies += [
                    f'<body name="link{k}" {place}>',
                    f'<joint name="{joint}" {moves} {attributes.get(joint, "")}/>',
                ]
            opened += 2 if joint in twist else 1
            i = link.inertia
            full = _text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
            bodies.append(f'<inertial pos="{_text(link.com)}" mass="{link.mass!r}" fullinertia="{full}"/>')
        return "\n".join(
            [
                '<mujoco><compiler angle="radian" eulerseq="XYZ"/>',
                f'<option timestep="{timestep!r}" integrator="implicitfast" gravity="{_text(gravity)}">',
                '<flag contact="disable"/></option>',
                "<worldbody>",
                *bodies,
                "</body>" * opened,
                "</worldbody></mujoco>",
            ]
        )


def random_arm(rng: np.random.Generator, n_joints: int, prismatic_share: float = 0.0) -> Arm:
    """A plausible arm: masses 2 to 20 kg falling towards the tip, lengths 0.15 to 0.6 m, no axis like the one before.

    The inertia is that of a slender body turned a little in its frame, so it is physical and has all six entries.
    """
    masses = np.sort(rng.uniform(2.0, 20.0, n_joints))[::-1]
    lengths = rng.uniform(0.15, 0.6, n_joints)
    links, last_axis = [], 2
    for k in range(n_joints):
        prismatic = rng.random() < prismatic_share
        axis = int(rng.choice([a for a in range(3) if a != last_axis]))
        width = rng.uniform(0.04, 0.09, 2)
        spread = masses[k] * np.array([width[0] ** 2, width[1] ** 2, lengths[k] ** 2 / 12.0])
        turn = _small_rotation(rng.normal(0.0, 0.1, 3))
        moments = turn @ np.diag(spread) @ turn.T
        links.append(
            Link(
                kind="prismatic" if prismatic else "revolute",
                origin=np.array([0.0, 0.0, lengths[k - 1] if k else 0.2]),
                rpy=rng.uniform(-0.5, 0.5, 3) if k else np.zeros(3),
                axis=np.eye(3)[axis],
                mass=float(masses[k]),
                com=np.array([*rng.normal(0.0, 0.02, 2), rng.uniform(0.35, 0.6) * lengths[k]]),
                inertia=np.trace(moments) * np.eye(3) - moments,
                travel=float(rng.uniform(0.1, 0.25) if prismatic else rng.uniform(1.2, 2.2)),
                speed=float(rng.uniform(0.2, 0.4) if prismatic else rng.uniform(1.0, 2.0)),
            )
        )
        last_axis = axis
    return Arm(tuple(links))


def length_axes(end: NDArray) -> NDArray:
    """Unit vectors by rows: along a vector (3,), and two across it."""
    along = end / np.linalg.norm(end)
    across = np.linalg.svd(along[None])[2][1:]
    return np.array([along, *across])


def _small_rotation(vector: NDArray) -> NDArray:
    """Cayley's rotation, exact for any size of vector."""
    x, y, z = vector / 2.0
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.linalg.solve(np.eye(3) - skew, np.eye(3) + skew)


def _point_inertia(mass: float, arm: NDArray) -> NDArray:
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def _text(numbers: ArrayLike) -> str:
    return " ".join(f"{x:.17g}" for x in np.asarray(numbers, float))
