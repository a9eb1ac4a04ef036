"""Random robots from 0.3 to 300 kg, 2 to 7 joints, written as URDF; and what a model's maker has wrong of them."""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that pinocchio takes from its compiled module)
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Rng = np.random.Generator

LIGHTEST, HEAVIEST = 0.3, 300.0  # kg
JOINTS = (2, 3, 3, 4, 5, 6, 6, 7)
ERROR = (0.01, 0.03)
"""What a URDF's masses, inertias and each coordinate of its centres of mass are off by, as shares."""

CALM = 0.35
"""Speed limits follow a pendulum's own frequency, about this share of sqrt(g / reach)."""


@dataclass(frozen=True, eq=False)
class Link:
    """A body and the joint it hangs on; ``inertia`` is about ``com``, both in the joint's frame [kg, m, rad]."""

    place: NDArray
    turn: NDArray
    axis: NDArray
    mass: float
    com: NDArray
    inertia: NDArray
    length: float
    travel: float
    speed: float


@dataclass(frozen=True, eq=False)
class Robot:
    """Links from the base on; joint k is ``joint1`` and so on."""

    links: tuple[Link, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(f"joint{k + 1}" for k in range(len(self.links)))

    def urdf(self) -> str:
        """As a URDF file."""
        rows = ['<robot name="arm">', '  <link name="base"/>']
        for k, link in enumerate(self.links):
            i = link.inertia
            rows += [
                f'  <link name="link{k + 1}"><inertial>',
                f'    <origin xyz="{_row(link.com)}" rpy="0 0 0"/><mass value="{link.mass!r}"/>',
                f'    <inertia ixx="{i[0, 0]!r}" ixy="{i[0, 1]!r}" ixz="{i[0, 2]!r}" iyy="{i[1, 1]!r}" '
                f'iyz="{i[1, 2]!r}" izz="{i[2, 2]!r}"/>',
                "  </inertial></link>",
                f'  <joint name="joint{k + 1}" type="revolute">',
                f'    <parent link="{f"link{k}" if k else "base"}"/><child link="link{k + 1}"/>',
                f'    <origin xyz="{_row(link.place)}" rpy="{_row(link.turn)}"/><axis xyz="{_row(link.axis)}"/>',
                f'    <limit lower="{-link.travel - 1.0!r}" upper="{link.travel + 1.0!r}" '
                'effort="1e6" velocity="100"/>',
                "  </joint>",
            ]
        return "\n".join([*rows, "</robot>", ""]).replace("np.float64(", "").replace(")", "")

    def model(self) -> pin.Model:
        """As Pinocchio reads that file."""
        return pin.buildModelFromXML(self.urdf())

    def changed(self, k: int, link: Link) -> "Robot":
        """With another link k."""
        return Robot((*self.links[:k], link, *self.links[k + 1 :]))


def _row(values: NDArray) -> str:
    return " ".join(repr(float(x)) for x in values)


def random_robot(rng: Rng) -> Robot:
    """Draw one: tubes that get lighter towards the tip, each with the next joint's motor at its end."""
    n = int(rng.choice(JOINTS))
    total = float(np.exp(rng.uniform(np.log(LIGHTEST), np.log(HEAVIEST))))
    reach = 0.45 * (total / 5.0) ** (1.0 / 3.0) * float(rng.uniform(0.7, 1.3))
    lengths = reach * rng.dirichlet(np.full(n, 6.0))
    masses = float(rng.uniform(0.55, 0.9)) ** np.arange(n) * rng.uniform(0.6, 1.4, n)
    masses *= total / masses.sum()
    links, before, last = [], np.zeros(3), -1
    for k in range(n):
        along = np.array([0.0, 0.0, lengths[k]]) + 0.15 * lengths[k] * rng.normal(size=3)
        motor, radius = float(rng.uniform(0.25, 0.6)), 0.12 * lengths[k] + 0.02 * reach
        tube, lump = (1.0 - motor) * masses[k], motor * masses[k]
        end = along * float(rng.uniform(0.6, 1.0)) + 0.2 * radius * rng.normal(size=3)
        middle = 0.5 * along
        com = (tube * middle + lump * end) / masses[k]
        inertia = tube * _rod(along, radius) + _point(tube, middle - com)
        inertia += lump * 0.4 * (0.8 * radius) ** 2 * np.eye(3) + _point(lump, end - com)
        which = int(rng.choice([a for a in range(3) if a != last]))
        turn = rng.uniform(-np.pi, np.pi, 3) if k == 0 else rng.choice([0.0, 0.0, 0.5, -0.5, 1.0], 3) * np.pi / 2.0
        links.append(
            Link(
                place=before,
                turn=turn + (0.0 if k == 0 else rng.uniform(-0.05, 0.05, 3)),
                axis=np.eye(3)[which],
                mass=float(masses[k]),
                com=com,
                inertia=inertia,
                length=float(lengths[k]),
                travel=float(rng.uniform(0.6, 1.7)),
                speed=float(rng.uniform(0.6, 1.5)) * CALM * float(np.sqrt(9.81 / reach)),
            )
        )
        before, last = along, which
    return Robot(tuple(links))


def _rod(along: NDArray, radius: float) -> NDArray:
    """Inertia a kilogram (3, 3) of a solid cylinder along a vector, about its middle."""
    length = float(np.linalg.norm(along))
    z = along / length
    side = radius**2 / 4.0 + length**2 / 12.0
    return side * np.eye(3) + (radius**2 / 2.0 - side) * np.outer(z, z)


def _point(mass: float, r: NDArray) -> NDArray:
    return mass * (r @ r * np.eye(3) - np.outer(r, r))


def with_body(robot: Robot, k: int, mass: float, place: NDArray, edge: float) -> Robot:
    """A solid cube bolted to link k: ``mass`` [kg], its middle at ``place`` [m], ``edge`` [m]."""
    link = robot.links[k]
    total = link.mass + mass
    com = (link.mass * link.com + mass * place) / total
    inertia = link.inertia + _point(link.mass, link.com - com)
    inertia = inertia + mass * edge**2 / 6.0 * np.eye(3) + _point(mass, place - com)
    return robot.changed(k, replace(link, mass=total, com=com, inertia=inertia))


def with_com(robot: Robot, k: int, shift: NDArray) -> Robot:
    """Link k's centre of mass shifted [m]; its inertia about it stays."""
    return robot.changed(k, replace(robot.links[k], com=robot.links[k].com + shift))


def believed(robot: Robot, rng: Rng) -> Robot:
    """What the URDF says: every mass, centre and inertia off by a share of `ERROR`, either way."""

    def off(size: int = 1) -> NDArray:
        return rng.choice([-1.0, 1.0], size) * rng.uniform(*ERROR, size)

    links = []
    for link in robot.links:
        mass, inertia = link.mass * float(1.0 + off()[0]), link.inertia * float(1.0 + off()[0])
        links.append(replace(link, mass=mass, com=link.com * (1.0 + off(3)), inertia=inertia))
    return Robot(tuple(links))
