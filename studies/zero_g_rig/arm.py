"""The plant's own description of a seven-joint arm: rigid links, two flexible booms, hang units and their slides.

Only numbers are taken from the model that the tool is given (lengths, masses, hang points); no equation is. Frames:
every link's frame has its origin on the link's joint axis and, with all joints at zero, stands parallel to the world's
(x along the arm, z up). Metres, kilograms, newtons, radians.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.rig.rig import Rig

Array = NDArray[np.float64]

GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Boom:
    """A tube along x that bends and twists at its middle, where the link is cut into two rigid parts.

    The outer part is a uniform tube of half the boom's mass; the inner part is all the rest of the link.

    Parameters
    ----------
    cut : array (3,)
        The tube's middle in the link's frame [m].
    length, mass, radius : float
        Of the whole tube [m, kg].
    torsion, bending : float
        Springs at the cut [N·m/rad].
    damping : float
        Of these springs, as a time [s]: damper = damping · spring.
    misfit : float
        Twist at which the torsion spring is at rest [rad].
    """

    cut: Array
    length: float = 3.7
    mass: float = 60.0
    radius: float = 0.16
    torsion: float = 5e5
    bending: float = 1e8
    damping: float = 0.02
    misfit: float = 0.0


@dataclass(frozen=True, eq=False)
class RigLink:
    """A moving body and the joint before it.

    Parameters
    ----------
    axis : "x" or "z"
        Of the joint.
    offset : array (3,)
        From the previous link's origin to this one's [m].
    mass, com, inertia : float, array (3,), array (3, 3)
        Inertia about the centre of mass, in the link's frame.
    boom : Boom or None
    """

    axis: str
    offset: Array
    mass: float
    com: Array
    inertia: Array
    boom: Boom | None = None


@dataclass(frozen=True, eq=False)
class HangUnit:
    """A hang unit: the sling pulls at ``point`` [m] of link number ``link`` with ``weight`` [N] when all is well.

    A load cell in the sling reads ``hardware`` [N] more: the unit's own rods and plate.
    """

    name: str
    link: int
    point: Array
    weight: float
    hardware: float


@dataclass(frozen=True, eq=False)
class SlideContact:
    """A slide's contact (the paper's G or F) on link number ``link``: point [m, link's frame] and normal load [N]."""

    link: int
    point: Array
    load: float


@dataclass(frozen=True, eq=False)
class Arm:
    """Links from the base outwards, hang units and the slides' contacts."""

    links: Sequence[RigLink]
    units: Sequence[HangUnit]
    contacts: Sequence[SlideContact]

    @property
    def joints(self) -> tuple[str, ...]:
        """``joint1`` and so on."""
        return tuple(f"joint{i + 1}" for i in range(len(self.links)))

    def with_booms(self, **changes: float) -> "Arm":
        """The arm with every boom changed alike."""
        links = [x if x.boom is None else replace(x, boom=replace(x.boom, **changes)) for x in self.links]
        return replace(self, links=links)

    def with_boom(self, link: int, **changes: float) -> "Arm":
        """The arm with one boom changed, that of link number ``link``."""
        links = list(self.links)
        boom = links[link].boom
        if boom is None:
            raise ValueError(f"link {link} has no boom")
        links[link] = replace(links[link], boom=replace(boom, **changes))
        return replace(self, links=links)


BOOMS = {2: Boom(np.array([2.1, 0.0, 0.15])), 3: Boom(np.array([2.1, 0.0, -0.15]))}
"""Which links of the built-in rig are booms."""


def arm_of(rig: Rig) -> Arm:
    """The rig's numbers in the plant's terms; a slide carries its unit's weight on two contacts."""
    links = []
    for i, (joint, link) in enumerate(zip(rig.joints, rig.links, strict=True)):
        mass, moment, about = link.phi[0], link.phi[1:4], link.phi[4:]
        com = moment / mass
        xx, xy, xz, yy, yz, zz = about
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - shift(mass, com)
        axis = "xyz"[int(np.argmax(np.abs(joint.axis)))]
        links.append(RigLink(axis, joint.translation, float(mass), com, inertia, BOOMS.get(i)))
    units = [HangUnit(s.name, s.link, s.point, s.weight, s.hardware) for s in rig.slings]
    contacts = [SlideContact(s.link, point, s.weight / len(s.slide)) for s in rig.slings for point in s.slide]
    return Arm(links, units, contacts)


def shift(mass: float, r: Array) -> Array:
    """Inertia (3, 3) of a point mass at r (3,) about the origin."""
    return mass * (r @ r * np.eye(3) - np.outer(r, r))
