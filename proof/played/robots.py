"""Arms as published: URDFs of the package `example-robot-data`, and what a model's maker has wrong of each.

A case's URDF is the published one without its meshes, its joints and links called joint1, link1 and so on. Its masses,
centres and inertias are off by a few per cent of those that the recordings are made with. Grippers stand still, and no
recording has them.
"""

# pyright: reportAttributeAccessIssue=false
# (pyright does not see the names that pinocchio takes from its compiled module)
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Rng = np.random.Generator

ARMS = {
    "panda_description/urdf/panda.urdf": 7,
    "ur_description/urdf/ur3_robot.urdf": 6,
    "ur_description/urdf/ur5_robot.urdf": 6,
    "ur_description/urdf/ur10_robot.urdf": 6,
    "kinova_description/robots/kinova.urdf": 6,
    "xarm_description/urdf/xarm7.urdf": 7,
    "z1_description/urdf/z1.urdf": 6,
}
"""Of each, how many joints from the base on are recorded."""

ERROR = (0.01, 0.05)
"""What a URDF's masses, inertias and each coordinate of its centres of mass are off by, as shares."""


def published() -> dict[str, Path]:
    """Arms that are there, by their file; none without the package."""
    try:
        place = distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")
    except PackageNotFoundError:
        return {}
    return {name: path for name in ARMS if (path := Path(str(place)) / name).exists()}


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm: URDF as text, its joints that move, and true inertial parameters of their bodies.

    ``masses`` (J,) kg, ``coms`` (J, 3) m and ``inertias`` (J, 3, 3) kg·m² about the centre, in the joint's frame; all
    that is bolted to a body belongs to it. ``gravity`` is along -z.
    """

    urdf: str
    joints: tuple[str, ...]
    links: tuple[str, ...]
    model: pin.Model
    masses: NDArray
    coms: NDArray
    inertias: NDArray
    low: NDArray
    high: NDArray
    speed: NDArray
    effort: NDArray

    def dynamics(self) -> "Dynamics":
        """Inverse dynamics with these parameters."""
        return Dynamics(self)


class Dynamics:
    """Torque of rigid bodies along a motion, by Pinocchio's recursive Newton-Euler."""

    def __init__(self, arm: Arm) -> None:
        """Takes the numbers; the model itself stays as it is."""
        self._model = pin.Model(arm.model)
        for k in range(len(arm.joints)):
            self._model.inertias[k + 1] = pin.Inertia(float(arm.masses[k]), arm.coms[k], arm.inertias[k])
        self._data = self._model.createData()

    def torque(self, q: NDArray, qd: NDArray, qdd: NDArray) -> NDArray:
        """Joint torques (n, J) [N·m] along a motion, each (n, J)."""
        rnea, model, data = pin.rnea, self._model, self._data
        return np.array([rnea(model, data, a, b, c) for a, b, c in zip(q, qd, qdd, strict=True)])

    def tip(self, q: NDArray) -> tuple[NDArray, NDArray]:
        """Place (3,) of the last joint's frame, and its Jacobian (3, J) in the base's axes."""
        last = self._model.njoints - 1
        jacobian = pin.computeJointJacobians(self._model, self._data, q)
        pin.updateGlobalPlacements(self._model, self._data)
        jacobian = pin.getJointJacobian(self._model, self._data, last, pin.LOCAL_WORLD_ALIGNED)
        return np.array(self._data.oMi[last].translation), np.array(jacobian[:3])


def load(path: Path, count: int) -> Arm:
    """A published arm without its meshes, all but its first joints locked where the URDF's zero is."""
    root = ET.fromstring(path.read_text(encoding="utf-8"))
    for link in root.iter("link"):
        for part in ("visual", "collision"):
            for old in link.findall(part):
                link.remove(old)
    for name in ("transmission", "gazebo", "material", "sensor"):
        for old in root.findall(name):
            root.remove(old)
    _renamed(root, count)
    text = ET.tostring(root, encoding="unicode")
    for joint in root.iter("joint"):
        if joint.get("type") == "continuous":  # Pinocchio would give it two coordinates
            joint.set("type", "revolute")
            joint.find("limit").attrib.update(lower="-6.3", upper="6.3")  # type: ignore
    whole = pin.buildModelFromXML(ET.tostring(root, encoding="unicode"))
    joints = tuple(f"joint{k + 1}" for k in range(count))
    locked = [k for k in range(1, whole.njoints) if whole.names[k] not in joints]
    model = pin.buildReducedModel(whole, locked, pin.neutral(whole))
    own = [model.inertias[k + 1] for k in range(count)]
    low, high = np.array(model.lowerPositionLimit[:count]), np.array(model.upperPositionLimit[:count])
    return Arm(
        text,
        joints,
        tuple(f"link{k + 1}" for k in range(count)),
        model,
        np.array([i.mass for i in own]),
        np.array([i.lever for i in own]),
        np.array([i.inertia for i in own]),
        np.clip(low, -2.8, 2.8),
        np.clip(high, -2.8, 2.8),
        np.clip(np.array(model.velocityLimit[:count]), 0.5, 3.0),
        np.array(model.effortLimit[:count]),
    )


def _renamed(root: ET.Element, count: int) -> None:
    """The first joints that move, and the links behind them, in the order of the file's tree."""
    moving = [j for j in root.iter("joint") if j.get("type") in ("revolute", "continuous", "prismatic")][:count]
    names: dict[str, str] = {}
    for k, joint in enumerate(moving, 1):
        names[str(joint.get("name"))] = f"joint{k}"
        names[str(joint.find("child").get("link"))] = f"link{k}"  # type: ignore
    for part in root.iter():
        for key in ("name", "link", "joint"):
            if part.get(key) in names:
                part.set(key, names[str(part.get(key))])


def true_arm(arm: Arm, rng: Rng) -> Arm:
    """The machine behind a URDF: every number of its bodies off by a share of `ERROR`, either way."""

    def factors(*shape: int) -> NDArray:
        return 1.0 + rng.uniform(*ERROR, shape) * rng.choice([-1.0, 1.0], shape)

    J = len(arm.joints)
    inertias = arm.inertias * factors(J)[:, None, None]
    return replace(arm, masses=arm.masses * factors(J), coms=arm.coms * factors(J, 3), inertias=inertias)


def with_load(arm: Arm, k: int, mass: float, place: NDArray) -> Arm:
    """A point mass [kg] bolted to body k at a place [m] in the joint's frame."""
    total = arm.masses[k] + mass
    com = (arm.masses[k] * arm.coms[k] + mass * place) / total
    inertia = arm.inertias[k] + _point(arm.masses[k], arm.coms[k] - com) + _point(mass, place - com)
    masses, coms, inertias = arm.masses.copy(), arm.coms.copy(), arm.inertias.copy()
    masses[k], coms[k], inertias[k] = total, com, inertia
    return replace(arm, masses=masses, coms=coms, inertias=inertias)


def with_com(arm: Arm, k: int, shift: NDArray) -> Arm:
    """Body k's centre of mass shifted [m]; its inertia about the centre stays."""
    coms = arm.coms.copy()
    coms[k] += shift
    return replace(arm, coms=coms)


def _point(mass: float, r: NDArray) -> NDArray:
    return mass * (r @ r * np.eye(3) - np.outer(r, r))
