"""A zero-gravity test rig: an arm hung from slings that carry its weight, and the rig this package has built in.

Every hang unit holds one body of the arm from a sling that stays vertical, and slides on that body's joint at its
contacts G and F (Tian, Tang, Dai and Li, fig. 8). In balance the slings carry every link without a torque on any joint:
the arm moves as if there were no gravity. What the arm's mass properties or the slings' tensions differ from that
balance shows under gravity.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ..inertia import Array, from_central, to_central
from ..tree import Joint, Link, Tree
from .points import point_motion

if TYPE_CHECKING:
    from ..regressor import Regressor
    from ..rigid_body import RigidBody


@dataclass(frozen=True, eq=False)
class Sling:
    """One hang unit: where it holds the arm, and what it carries in balance.

    Parameters
    ----------
    name : str
        As in a recording's ``tension.<name>``.
    link : int
        Index of the link that it holds.
    point : array (3,)
        Hang point in that link's frame [m]: where the sling's line meets the body.
    weight : float
        Weight of the arm that it carries in balance, the paper's G_1 [N].
    hardware : float
        Weight of its own rods, plate and half bar below the tension's sensor, 2 G_2 + G_3 + G_4 / 2 [N].
    slide : array (k, 3)
        Contacts (the paper's G and F) at which the unit slides when the link's joint moves, in the link's frame [m].
        No row: no slide.
    """

    name: str
    link: int
    point: Array
    weight: float
    hardware: float
    slide: Array

    @property
    def tension(self) -> float:
        """Tension in balance, the paper's N_A [N]."""
        return self.weight + self.hardware


@dataclass(frozen=True, eq=False)
class Rig(Tree):
    """An arm on its slings; gravity points along -z of the world.

    Raises
    ------
    InputError
        As `Tree` does, or where gravity is not along -z, a sling's link is not there, its weight is negative, a name is
        used twice, or a contact lies on its joint's axis.
    """

    slings: tuple[Sling, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what no rig can be."""
        super().__post_init__()
        if self.followers:
            raise InputError(
                f"{self.name}: joint '{self.followers[0].joint.name}' mimics another, which no rig has equations for; "
                "make both fixed in a copy of the URDF"
            )
        if self.gravity[0] or self.gravity[1] or not self.gravity[2] < 0:
            raise InputError(
                f"{self.name}: gravity is {self.gravity.tolist()}; slings hang along z, so a rig needs [0.0, 0.0, -g] "
                "with g > 0 (without slings in error, the model takes gravity out itself)"
            )
        names = [*(j.name for j in self.joints), *(s.name for s in self.slings)]
        for sling in self.slings:
            if names.count(sling.name) > 1:
                raise InputError(f"{self.name}: sling '{sling.name}' has the name of another sling or joint; rename it")
            if not 0 <= sling.link < self.n_joints:
                raise InputError(
                    f"{self.name}: sling '{sling.name}' holds link number {sling.link}; "
                    f"allowed are 0 to {self.n_joints - 1}"
                )
            if not (sling.weight >= 0 and sling.hardware >= 0):
                raise InputError(
                    f"{self.name}: sling '{sling.name}' carries {sling.weight} N and {sling.hardware} N of hardware; "
                    "give weights of zero or more"
                )
            for contact in sling.slide:
                self.tangent_of(sling, contact)

    @property
    def stands(self) -> bool:
        """Slings never hang quite still: friction lets go of what it holds, and every joint moves what they carry."""
        return False

    @property
    def balanced(self) -> bool:
        """The slings take it."""
        return True

    @property
    def tensions(self) -> tuple[str, ...]:
        """The slings'."""
        return tuple(s.name for s in self.slings)

    def link_at(self, kind: str, name: str) -> int | None:
        """A sling's is the link that it holds, all slings' together the first one's."""
        if kind == "suspension":
            return self.slings[0].link
        if kind != "sling":
            return super().link_at(kind, name)
        return next(s.link for s in self.slings if s.name == name)

    def carried(
        self, body: "RigidBody", q: Array, regressor: Callable[[], "Regressor"], tension: Mapping[str, Array]
    ) -> Array:
        """In balance the weight of the arm as the model gives it, so that all which differs from the model's masses
        shows under gravity. A measured tension adds what it exceeds the balance by."""
        total = body.torque(q, np.zeros_like(q), np.zeros_like(q))
        for sling in self.slings:
            if sling.name in tension:
                held = point_motion(self, sling.link, sling.point, q, np.zeros_like(q))
                total += held.jacobian[:, 2] * (tension[sling.name] - sling.tension)[:, None]
        return total

    def tangent_of(self, sling: Sling, contact: Array) -> Array:
        """Unit vector (3,) in the link's frame along which a contact slides as the link's joint moves forward."""
        joint = self.joints[sling.link]
        if joint.kind == "prismatic":
            return joint.axis
        across = np.cross(joint.axis, contact)
        length = float(np.linalg.norm(across))
        if length < 1e-9:
            raise InputError(
                f"{self.name}: sling '{sling.name}' has a slide contact {contact.tolist()} on the axis of joint "
                f"'{joint.name}'; friction there turns nothing: give a point beside the axis"
            )
        return across / length

    def outboard(self, link: int) -> tuple[Sling, ...]:
        """Slings on links beyond a link, seen from the base."""
        beyond = {link}
        for i, joint in enumerate(self.joints):
            if joint.parent in beyond:
                beyond.add(i)
        return tuple(s for s in self.slings if s.link in beyond - {link})


class HangUnitLoads(NamedTuple):
    """Forces in a hang unit [N]: sling at the bar (A), at the plate (B), in both rods (D and C), and C with F."""

    bar: float
    plate: float
    rods: float
    joint: float


def hang_unit_loads(joint: float, rod: float, plate: float, bar: float) -> HangUnitLoads:
    """Force balance of one hang unit (Tian, Tang, Dai and Li, eq. 12).

    Parameters
    ----------
    joint, rod, plate, bar : float
        Weights G_1 of the joint with its slide, G_2 of one vertical rod, G_3 of the plate, G_4 of the bar that two
        units share [N].

    Returns
    -------
    HangUnitLoads
        N_A = G_1 + 2 G_2 + G_3 + G_4/2; N_B = G_1 + 2 G_2 + G_3; N_D + N_C = G_1 + 2 G_2; N_C + N_F = G_1.
    """
    rods = joint + 2 * rod
    return HangUnitLoads(rods + plate + bar / 2, rods + plate, rods, joint)


# ---- The built-in rig. The paper gives no numbers: every one below is chosen, for a simulated arm of the 10 m class.

ROD, PLATE, BAR = 15.0, 25.0, 40.0
"""Weights of a vertical rod, a triangular plate and a bar [N] (chosen)."""

SLIDE_RADIUS = 0.25
"""[m] From the joint's axis to the contacts G and F, on opposite sides of it (chosen)."""

# Each joint's axis, and its origin on the link before it [m].
_AXES = ("z", "x", "z", "z", "z", "x", "z")
_ORIGINS = ((0, 0, 0), (0.45, 0, 0), (0.45, 0, 0), (4.2, 0, 0.3), (4.2, 0, -0.3), (0.45, 0, 0), (0.45, 0, 0))

# Of each link: cylinders along x, as (mass [kg], centre [m], length [m], radius [m]). A joint's housing everywhere; on
# link 3 and 4 a boom (a cage, so a thin tube), on link 4 the central controller, on link 7 the end effector.
_HOUSING = 40.0
_PARTS = (
    ((_HOUSING, (0.15, 0.01, -0.02), 0.45, 0.2),),
    ((_HOUSING, (0.15, -0.01, 0.02), 0.45, 0.2),),
    ((_HOUSING, (0.05, 0.02, -0.02), 0.45, 0.2), (60.0, (2.1, 0.0, 0.15), 3.7, 0.16)),
    (
        (_HOUSING, (0.05, -0.02, 0.02), 0.45, 0.2),
        (60.0, (2.1, 0.0, -0.15), 3.7, 0.16),
        (80.0, (0.5, 0.0, -0.05), 0.7, 0.25),
    ),
    ((_HOUSING, (0.15, 0.01, 0.02), 0.45, 0.2),),
    ((_HOUSING, (0.15, 0.02, -0.01), 0.45, 0.2),),
    ((_HOUSING, (0.10, -0.01, 0.02), 0.45, 0.2), (90.0, (0.7, 0.02, -0.02), 0.8, 0.25)),
)

# Links held by two units: how far along x each is from the link's origin [m]. The first is the joint's own.
_TWO_UNITS = {2: (0.0, 4.0), 3: (0.1, 4.0), 6: (0.1, 0.8)}


def built_in_rig(gravity: ArrayLike = (0.0, 0.0, -9.81)) -> Rig:
    """The built-in rig: seven joints with axes z x z z z x z, ten hang units, all numbers chosen.

    Straight along x at zero, 11.3 m long, 570 kg. ``joint1`` ... ``joint7`` move ``link1`` ... ``link7``; joints 3, 4
    and 5 are shoulder, elbow and wrist of two booms of 4.2 m. Units ``sling1`` ... ``sling10`` from the base outward
    hold links 1, 2, 3, 3, 4, 4, 5, 6, 7, 7: one through the centre of mass where a link has one; where it has two, on a
    line through the centre of mass along the link, sharing its weight by the lever. The unit at each joint slides on
    two contacts, 0.25 m either side of the axis along the link's y.

    Parameters
    ----------
    gravity : array (3,)
        [m/s²]; along -z, or InputError is raised.
    """
    down = np.asarray(gravity, float)
    joints = tuple(
        Joint(f"joint{i + 1}", "revolute", np.eye(3)["xyz".index(axis)], i - 1, np.eye(3), np.array(origin, float))
        for i, (axis, origin) in enumerate(zip(_AXES, _ORIGINS, strict=True))
    )
    links = tuple(
        Link(f"link{i + 1}", np.sum([_cylinder(*part) for part in parts], axis=0)) for i, parts in enumerate(_PARTS)
    )
    slings: list[Sling] = []
    for i, link in enumerate(links):
        contacts = np.array([[0, SLIDE_RADIUS, 0], [0, -SLIDE_RADIUS, 0]])
        for point, weight in _held(link.phi, -float(down[2]), _TWO_UNITS.get(i)):
            hardware = hang_unit_loads(weight, ROD, PLATE, BAR).bar - weight
            slings.append(Sling(f"sling{len(slings) + 1}", i, point, weight, hardware, contacts))
            contacts = np.zeros((0, 3))
    return Rig("zero_g_rig", joints, links, down, tuple(slings))


def _cylinder(mass: float, centre: ArrayLike, length: float, radius: float) -> Array:
    across = mass * (radius**2 / 4 + length**2 / 12)
    return from_central(mass, centre, np.diag([mass * radius**2 / 2, across, across]))


def _held(phi: Array, gravity: float, along: tuple[float, float] | None) -> list[tuple[Array, float]]:
    """Hang points and the weights [N] they carry, without a moment left on the link."""
    mass, com, _ = to_central(phi)
    if along is None:
        return [(com, mass * gravity)]
    near, far = along
    share = (com[0] - near) / (far - near)
    x = np.array([1.0, 0.0, 0.0])
    return [(com + (at - com[0]) * x, part * mass * gravity) for at, part in ((near, 1 - share), (far, share))]
