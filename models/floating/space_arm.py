"""A station arm of seven joints on a base of 40 t, for the captures in orbit.

Of the class of the European Robotic Arm, whose length, mass, number and order of joints, and tip speed it has (ESA,
*European Robotic Arm*, data sheet). Everything else is *chosen* and marked so: a study must show how its result moves
with it. Straight up at zero, along the base's z: roll, yaw, pitch; elbow; pitch, yaw, roll.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ..effects import get_effect
from ..inertia import Array, from_central, transform
from ..model import PlacedEffect
from ..tree import Joint, Link, Tree
from .arm import FloatingArm
from .dynamics import generalized_inertia
from .joint_drive import Drive

BASE_MASS = 40e3  # kg; Tian et al., the inspection case
BASE_LENGTH, BASE_RADIUS = 12.0, 2.1  # m, chosen: a cylinder of uniform density along x, the size of one station module
MOUNT = (4.0, 0.0, BASE_RADIUS)  # m from the base's centre of mass, chosen: on the hull

LENGTH, MASS = 11.3, 630.0  # m, kg; ESA
SPEED = 0.05
"""Speed limit of a joint [rad/s], chosen: a limb of 5 m then swings its end at 2.5 times the tip speed."""

_ROLL, _PITCH, _YAW = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
_HOUSING, _LIMB = 0.15, 0.13  # m, chosen: radii of the joints' housings (solid) and of the limbs (tubes)

# axis; length to the next joint [m]; mass [kg]. Chosen so that they sum up to ESA's length and mass with the first
# 0.35 m and 100 kg, the end effector that holds the base. The limbs are ESA's "about 5 m" with half an elbow each.
_LINKS = (
    ("joint1", _ROLL, 0.4, 55.0),
    ("joint2", _YAW, 0.4, 55.0),
    ("joint3", _PITCH, 4.4, 105.0),
    ("joint4", _PITCH, 4.4, 105.0),
    ("joint5", _PITCH, 0.4, 55.0),
    ("joint6", _YAW, 0.4, 55.0),
    ("joint7", _ROLL, 0.55, 100.0),
)
_FOOT = (0.35, 100.0)

CAPTURE_POSE = (0.0, 0.3, 0.7, -1.5, 1.3, -0.3, 0.0)
"""Joint positions [rad], chosen: elbow bent by 86°, wrist turned, far from every singularity."""

FRICTION: Mapping[str, float] = {
    "coulomb_level": 10.0,
    "coulomb_speed": 5e-5,
    "stribeck_level": 3.0,
    "stribeck_speed": 5e-5,
    "stribeck_ratio": 20.0,
    "viscous_coefficient": 100.0,
}
"""Makkar friction of one joint that is driven backwards through its gear [N·m, rad/s, N·m·s/rad], chosen.

No maker of such an arm publishes it. 10 N·m is 1 N at the tip of the stretched arm. A smooth law creeps where real
friction holds: at half the level by 3e-5 rad/s, which is 0.3 mm/s at the tip.
"""

ROTOR_INERTIA = 25.0
"""Of one motor, times the gear ratio squared [kg·m²], chosen: 1e-4 kg·m² through 1:500."""


def space_arm(floating: bool = True, end_effector: ArrayLike | None = None) -> FloatingArm:
    """The arm on its base; the tip is the interface at its end, z along the last link.

    Parameters
    ----------
    floating : bool
        Whether the base floats or stands still.
    end_effector : array (10,), optional
        Inertial parameters phi, about the tip's frame, of what the wrist carries beyond its own end.
    """
    joints, links = [], []
    place = np.add(MOUNT, (0.0, 0.0, _FOOT[0]))
    for i, (name, axis, length, mass) in enumerate(_LINKS):
        joints.append(Joint(name, "revolute", np.array(axis), i - 1, np.eye(3), place, speed=SPEED))
        links.append(Link(f"link{i + 1}", _cylinder(mass, length, tube=length > 1)))
        place = np.array([0.0, 0.0, length])
    if end_effector is not None:
        phi = np.asarray(end_effector, float)
        if phi.shape != (10,) or not np.isfinite(phi).all():
            raise InputError(f"space_arm: end_effector has shape {phi.shape}; give phi, 10 finite numbers")
        links[-1] = Link(links[-1].name, links[-1].phi + _shifted(phi, place))
    foot = _shifted(_cylinder(_FOOT[1], _FOOT[0]), np.array(MOUNT))
    across = BASE_MASS * (3 * BASE_RADIUS**2 + BASE_LENGTH**2) / 12
    hull = from_central(BASE_MASS, np.zeros(3), np.diag([0.5 * BASE_MASS * BASE_RADIUS**2, across, across]))
    tree = Tree("space_arm", tuple(joints), tuple(links), np.zeros(3))
    return FloatingArm(tree, hull + foot, len(links) - 1, tip_translation=place, floating=floating)


def space_arm_drive(arm: FloatingArm, bandwidth: float = 1.0, pose: ArrayLike = CAPTURE_POSE) -> Drive:
    """Servo, friction and rotors of the space arm; `FloatingMotion.advance` turns its motors on and off.

    The servo is critically damped at ``bandwidth`` [rad/s, chosen] in ``pose`` (J,), joint by joint; friction is
    `FRICTION` and `ROTOR_INERTIA` on every joint, each number a parameter of the simulation.
    """
    rotor = [(get_effect("rotor_inertia"), {"inertia": ROTOR_INERTIA})]
    placed, values = [], {}
    for joint in arm.tree.joints:
        for effect, numbers in [(get_effect("makkar_friction"), FRICTION), *rotor]:
            placed.append(PlacedEffect(effect, joint.name))
            values |= {f"{effect.name}.{joint.name}.{name}": value for name, value in numbers.items()}
    inertia = np.diag(generalized_inertia(arm, np.asarray(pose, float)[None, :])[0]) + ROTOR_INERTIA
    return Drive(bandwidth**2 * inertia, 2 * bandwidth * inertia, placed, values)


def _cylinder(mass: float, length: float, tube: bool = False) -> Array:
    """Parameters phi (10,) of a cylinder, or a thin tube, that stands on the origin along z."""
    radius = _LIMB if tube else _HOUSING
    across = mass * ((6 if tube else 3) * radius**2 + length**2) / 12
    along = mass * radius**2 * (1.0 if tube else 0.5)
    return from_central(mass, [0.0, 0.0, length / 2], np.diag([across, across, along]))


def _shifted(phi: Array, place: Array) -> Array:
    return transform(phi, np.eye(3), place)
