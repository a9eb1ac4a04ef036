"""A tree with some of its joints held: what they carry is welded to what carries them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError, nearest
from .inertia import Array, transform
from .tree import Follower, Joint, Link, Tree


def hold(tree: Tree, angles: Mapping[str, float]) -> Tree:
    """The tree with joints held at angles [rad or m]; followers of a held joint stand with it.

    Parameters
    ----------
    tree : Tree
    angles : mapping of str to float
        Position of each joint that is held. Nothing held is the tree itself.

    Raises
    ------
    InputError
        A name that no joint has, or nothing is left to move.
    """
    known = [joint.name for joint in tree.joints]
    for name in angles:
        if name not in known:
            raise InputError(
                f"{tree.name}: joint {name!r} is not one that moves ({', '.join(known)}); did you mean "
                f"{nearest(name, known)!r}?"
            )
    if not angles:
        return tree
    if len(angles) == len(known):
        raise InputError(f"{tree.name}: all {len(known)} joints are held; let at least one move")
    index = {i: k for k, i in enumerate(i for i, name in enumerate(known) if name not in angles)}
    joints: list[Joint] = []
    followers: list[Follower] = []
    links: list[Link] = []
    carriers: list[tuple[int, Array, Array]] = []  # of every body: the link it moves with now, and its pose there
    for body, (joint, leader, times, offset) in enumerate(tree.bodies):
        carrier, turned, moved = (-1, np.eye(3), np.zeros(3)) if joint.parent < 0 else carriers[joint.parent]
        rotation, translation = turned @ joint.rotation, turned @ joint.translation + moved
        if leader in index:
            made = replace(joint, parent=carrier, rotation=rotation, translation=translation)
            if body < tree.n_joints:
                joints.append(made)
            else:
                followers.append(Follower(made, index[leader], times, offset))
            carriers.append((len(links), np.eye(3), np.zeros(3)))
            links.append(tree.links[body])
            continue
        place = times * angles[known[leader]] + offset
        if joint.kind == "revolute":
            rotation = rotation @ Rotation.from_rotvec(place * joint.axis).as_matrix()
        else:
            translation = translation + rotation @ joint.axis * place
        carriers.append((carrier, rotation, translation))
        if carrier >= 0:
            carrying = links[carrier]
            links[carrier] = Link(carrying.name, carrying.phi + transform(tree.links[body].phi, rotation, translation))
    moving = {joint.name for joint in joints}
    axes = tuple(axis for axis in tree.axes if moving & set(axis.along))
    return replace(tree, joints=tuple(joints), links=tuple(links), followers=tuple(followers), axes=axes)
