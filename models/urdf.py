"""A URDF file as a `Tree`: Drake reads the kinematics, the inertias are taken as published.

Drake's parser replaces an inertia that no body can have by another one, with a warning, and ends the process on limits
that cross. Inertias and limits are therefore read here, and `published_inertia` judges the bodies that they add up to.
A joint that mimics another is a follower of it.
Joint damping and friction in the file are not read: they are effects, to be identified. A limit that the file leaves
out is infinite.
"""

import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..errors import InputError, nearest
from ..extras import demand_drake
from ..files import content
from . import inertia
from .hold import hold
from .inertia import Array
from .mimic import grouped
from .published_inertia import Fix, checked_bodies
from .tree import Joint, Link, Tree

_MOST = 1000
_KINDS = ("revolute", "continuous", "prismatic", "fixed")
_KINEMATIC = ("parent", "child", "origin", "axis")
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def load_urdf(
    path: str | Path,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    *,
    held: Mapping[str, float] | None = None,
    moving: Sequence[str] | None = None,
    fix: Fix = "",
) -> Tree:
    """Read a URDF; its root link stands still in the world, links behind fixed joints are welded to what carries them.

    Parameters
    ----------
    path : str or Path
        Meshes need not be there: shapes are not read.
    gravity : array (3,)
        In the world frame [m/s²].
    held : mapping of str to float, optional
        Joints that are held, and where [rad or m].
    moving : sequence of str, optional
        The joints that move; all others are held, at zero where ``held`` does not say.
    fix : "" or "nearest"
        Whether a body that cannot be is refused, or gets the nearest inertia that one can have.

    Raises
    ------
    InputError
        Where the file is missing or is no URDF of one tree; a joint is not revolute, continuous, prismatic or fixed;
        a joint hangs behind one that mimics; nothing moves, or nothing that has mass; or a moving body's inertia is
        not physical.
    """
    path = Path(path)
    down = np.asarray(gravity, float)
    if down.shape != (3,) or not np.isfinite(down).all():
        raise InputError(f"{path}: gravity is {gravity}; give three finite numbers [m/s²]")
    robot = read_robot(path)
    root = checked_root(path, robot)
    parameters, odd = {}, {}
    for link in robot.findall("link"):
        name = link.get("name", "")
        parameters[name], alone = _link(path, link)
        if not inertia.is_physical(alone):
            odd[name] = alone
    limits = {joint.get("name", ""): _limits(path, joint) for joint in robot.findall("joint")}

    moved: list[tuple[Joint, Link]] = []
    for drake_joint, parent, rotation, translation in walk(parse_plant(path, robot, root), root):
        child = drake_joint.child_body().name()
        if drake_joint.type_name() == "weld":
            if parent >= 0:
                joint, carrier = moved[parent]
                phi = carrier.phi + inertia.transform(parameters[child], rotation, translation)
                moved[parent] = joint, Link(carrier.name, phi)
            continue
        kind = "revolute" if drake_joint.type_name() == "revolute" else "prismatic"
        axis = drake_joint.revolute_axis() if kind == "revolute" else drake_joint.translation_axis()
        name = drake_joint.name()
        moved.append(
            (Joint(name, kind, axis, parent, rotation, translation, *limits[name]), Link(child, parameters[child]))
        )
    if not moved:
        raise InputError(f"{path}: no joint moves; give at least one revolute, continuous or prismatic joint")
    tree = grouped(path, robot, moved, down)
    angles = dict(held or {})
    if moving is not None:
        known = [joint.name for joint in tree.joints]
        for name in moving:
            if name not in known:
                raise InputError(
                    f"{path}: joint {name!r} is not one that moves ({', '.join(known)}); nearest is "
                    f"{nearest(name, known)!r}"
                )
        angles = {name: angles.get(name, 0.0) for name in known if name not in moving}
    try:
        return checked_bodies(path, hold(tree, angles), odd, fix)
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


def read_robot(path: Path) -> ET.Element:
    """The <robot> element; prefixes such as drake: stay as written, declared or not."""
    builder, parser = ET.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end

    def refuse_doctype(name: str, *_: object) -> None:
        raise InputError(f"{path}: declares a document type {name!r}, which a URDF has no use for; take it out")

    parser.StartDoctypeDeclHandler = refuse_doctype  # entities can stand for gigabytes
    try:
        parser.Parse(content(path), True)
    except InputError:
        raise
    except (expat.ExpatError, ValueError, LookupError) as problem:  # the last two: an encoding that expat lacks
        raise InputError(f"{path}: not XML ({problem}); give a URDF") from None
    robot = builder.close()
    if robot.tag != "robot":
        raise InputError(f"{path}: root element is <{robot.tag}>; a URDF has <robot>: convert the file")
    if any(element.tag.startswith("xacro:") for element in robot.iter()):
        raise InputError(f"{path}: holds xacro macros; expand it first: xacro {path.name} > expanded.urdf")
    return robot


def checked_root(path: Path, robot: ET.Element) -> str:
    """Name of the one root link; refuses what is not a tree of one-axis joints."""
    for element in robot:
        if element.tag.startswith("drake:") and element.tag != "drake:collision_filter_group":
            raise InputError(f"{path}: <{element.tag}> is not supported; use URDF's own joints, or remove it")
    for tag in ("link", "joint"):
        if len(robot.findall(tag)) > _MOST:
            raise InputError(f"{path}: has more than {_MOST} {tag}s; give one arm")
        twice = [name for name, count in Counter(e.get("name") for e in robot.findall(tag)).items() if count > 1]
        if twice:
            raise InputError(f"{path}: {tag} name '{twice[0]}' is given twice; give every {tag} its own name")
    carried: dict[str, str] = {}
    for joint in robot.findall("joint"):
        name, kind = joint.get("name"), joint.get("type")
        if kind not in _KINDS:
            raise InputError(f"{path}: joint '{name}' is of type '{kind}'; allowed are {', '.join(_KINDS)}")
        for part, key in (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")):
            found = joint.find(part)
            if found is not None and key in found.attrib:
                _numbers(path, f"joint '{name}': {part} {key}", found.get(key), 3)
        child = joint.find("child")
        link = "" if child is None else child.get("link", "")
        if link in carried:
            raise InputError(
                f"{path}: link '{link}' hangs on joints '{carried[link]}' and '{name}'; "
                "closed loops are not supported: cut one"
            )
        carried[link] = name or ""
    roots = [link.get("name", "") for link in robot.findall("link") if link.get("name", "") not in carried]
    if len(roots) != 1:
        shown = f"{roots[:5]} and {len(roots) - 5} more" if len(roots) > 5 else roots
        raise InputError(f"{path}: root links are {shown}; give exactly one link that is no joint's child")
    return roots[0]


def _numbers(path: Path, where: str, text: str | None, count: int) -> Array:
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise InputError(f"{path}: {where} is {text!r}; give {count} finite number{'s' * (count > 1)}")
    return values


def _limits(path: Path, joint: ET.Element) -> tuple[float, float, float, float]:
    """Lower and upper limit of position, of speed and of effort of one joint; infinite where the file has none."""
    limit, name = joint.find("limit"), f"joint '{joint.get('name')}'"
    given = {} if limit is None else limit.attrib
    keys = ("velocity", "effort") if joint.get("type") == "continuous" else ("lower", "upper", "velocity", "effort")
    values = {key: float(_numbers(path, f"{name}: limit {key}", given[key], 1)[0]) for key in keys if key in given}
    lower, upper, speed = values.get("lower", -np.inf), values.get("upper", np.inf), values.get("velocity", np.inf)
    if lower > upper or speed < 0:
        raise InputError(f"{path}: {name} has limits {given}; give lower <= upper and a velocity of at least 0")
    effort = values.get("effort", np.inf)
    return lower, upper, speed, effort if effort > 0 else np.inf  # many files have 0 where nobody knew


def link_parameters(path: Path, link: ET.Element) -> Array:
    """Inertial parameters phi (10,) of one link as published, about its own frame."""
    return _link(path, link)[0]


def _link(path: Path, link: ET.Element) -> tuple[Array, Array]:
    """Inertial parameters of one link as published: about its own frame, and about its centre of mass."""
    inertial = link.find("inertial")
    if inertial is None:
        return np.zeros(10), np.zeros(10)
    name = f"link '{link.get('name')}'"
    empty = ET.Element("absent")
    origin, mass_element, tensor = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    pose = (empty if origin is None else origin).attrib
    com = _numbers(path, f"{name}: inertial origin xyz", pose.get("xyz", "0 0 0"), 3)
    angles = _numbers(path, f"{name}: inertial origin rpy", pose.get("rpy", "0 0 0"), 3)
    given_mass = (empty if mass_element is None else mass_element).get("value")
    mass = float(_numbers(path, f"{name}: mass value", given_mass, 1)[0])
    given = [(empty if tensor is None else tensor).get(key) for key in _INERTIA]
    moments = [float(_numbers(path, f"{name}: {key}", text, 1)[0]) for key, text in zip(_INERTIA, given, strict=True)]
    if mass < 0:
        raise InputError(f"{path}: {name} has mass {mass:g} kg; give it a mass of at least 0, or no <inertial>")
    about_com = np.concatenate([[mass], np.zeros(3), moments])
    return inertia.transform(about_com, Rotation.from_euler("xyz", angles).as_matrix(), com), about_com


def parse_plant(path: Path, robot: ET.Element, root: str) -> Any:
    """Drake's plant of the bare kinematics, its root welded to the world."""
    # imported here: Drake takes a second to load, and most commands refuse bad input before they need it
    demand_drake()
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    bare = ET.Element("robot", {"name": "robot"})  # the URDF's own may be empty, which Drake does not bear
    for element in robot:
        if element.tag in ("link", "joint"):
            kept = ET.SubElement(bare, element.tag, element.attrib)
            for part in element:
                if element.tag == "joint" and part.tag in _KINEMATIC:
                    ET.SubElement(kept, part.tag, part.attrib)
    plant = MultibodyPlant(0.0)
    try:
        Parser(plant).AddModelsFromString(ET.tostring(bare, encoding="unicode"), "urdf")
        if root != "world":
            plant.WeldFrames(plant.world_frame(), plant.GetBodyByName(root).body_frame())
        plant.Finalize()
    except (RuntimeError, ValueError, SystemExit) as problem:  # the last is what Drake's failed conditions become
        reason = re.sub(r"^\S*literal-string\S*\s*(error: )?", "", " ".join(str(problem).split()))
        raise InputError(f"{path}: Drake cannot read it: {reason}") from None
    return plant


def walk(plant: Any, root: str) -> Iterator[tuple[Any, int, Array, Array]]:
    """Drake's joints, parents first: (joint, index of the moving joint that carries it or -1, rotation, translation).

    The pose is the joint's frame in its carrier's link frame, at rest; for a weld that of the body welded on.
    """
    from pydrake.math import RigidTransform

    outward: dict[str, list[Any]] = {}
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        outward.setdefault(joint.parent_body().name(), []).append(joint)
    pending = [(joint, -1, RigidTransform()) for joint in reversed(outward.get(root, []))]
    moving = 0
    while pending:
        joint, carrier, base = pending.pop()
        pose = base @ joint.frame_on_parent().GetFixedPoseInBodyFrame()
        if joint.type_name() == "weld":
            pose = pose @ joint.X_FM() @ joint.frame_on_child().GetFixedPoseInBodyFrame().inverse()
        yield joint, carrier, pose.rotation().matrix(), pose.translation()
        if joint.type_name() == "weld":
            behind, at = carrier, pose
        else:
            behind, at, moving = moving, RigidTransform(), moving + 1
        pending.extend((child, behind, at) for child in reversed(outward.get(joint.child_body().name(), [])))
