"""Joints of a URDF that mimic others, told apart from those that are freedoms of their own."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from .inertia import Array
from .tree import Follower, Joint, Link, Tree


def grouped(path: Path, robot: ET.Element, moved: Sequence[tuple[Joint, Link]], gravity: Array) -> Tree:
    """A tree of joints and the links that they move, in the order of a walk outwards, followers put behind.

    A joint that mimics one that the file has not is a joint of its own, and a note says so.

    Raises
    ------
    InputError
        Joints mimic one another in a ring, a factor is no number, or a joint hangs behind one that mimics.
    """
    names = [joint.name for joint, _ in moved]
    laws, notes = _laws(path, robot, names)
    places = {name: k for k, name in enumerate([n for n in names if n not in laws] + [n for n in names if n in laws])}
    joints: list[Joint] = []
    followers: list[Follower] = []
    links: dict[str, Link] = {}
    for joint, link in moved:
        carrier = names[joint.parent] if joint.parent >= 0 else ""
        made = replace(joint, parent=places[carrier] if carrier else -1)
        links[joint.name] = link
        if joint.name in laws:
            leader, times, offset = laws[joint.name]
            followers.append(Follower(made, places[leader], times, offset))
        elif carrier in laws:
            raise InputError(
                f"{path}: joint '{joint.name}' hangs behind '{carrier}', which mimics '{laws[carrier][0]}'; hold "
                f"them in the model file, as in locked = {{ {laws[carrier][0]} = 0.0 }}, or take the <mimic> out"
            )
        else:
            joints.append(made)
    ordered = tuple(links[name] for name in places)
    return Tree(robot.get("name", path.stem), tuple(joints), ordered, gravity, followers=tuple(followers), notes=notes)


def _laws(
    path: Path, robot: ET.Element, names: Sequence[str]
) -> tuple[Mapping[str, tuple[str, float, float]], tuple[str, ...]]:
    """Of each follower: the freedom it follows in the end, factor and offset; and what was not as it should be."""
    given: dict[str, tuple[str, float, float]] = {}
    lost: list[str] = []
    for joint in robot.findall("joint"):
        name, mimic = joint.get("name", ""), joint.find("mimic")
        if mimic is None or name not in names:
            continue
        leader = mimic.get("joint", "")
        if leader not in names:
            lost.append(
                f"joint '{name}' mimics '{leader}', which is no joint that moves; it is taken as one of its own"
            )
            continue
        given[name] = (leader, _number(path, name, mimic, "multiplier", 1.0), _number(path, name, mimic, "offset", 0.0))
    laws = {}
    for name, (leader, times, offset) in given.items():
        for _ in given:
            if leader not in given:
                break
            leader, more, further = given[leader]
            times, offset = times * more, times * further + offset
        if leader in given:
            raise InputError(f"{path}: joint '{name}' mimics joints that mimic it in turn; take one <mimic> out")
        laws[name] = (leader, times, offset)
    return laws, tuple(lost)


def _number(path: Path, name: str, mimic: ET.Element, key: str, or_else: float) -> float:
    text = mimic.get(key)
    try:
        value = or_else if text is None else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: joint '{name}': mimic {key} is {text!r}; give a finite number")
    return value
