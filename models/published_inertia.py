"""Whether the bodies of a robot, as published, are ones that can be: what to refuse, to mend, and only to note.

A file's links are judged as the bodies that move: a camera's frame of no extent that is welded to an arm matters only
through the arm, and what is welded to the base is felt by no joint.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from . import inertia
from .hold import hold
from .inertia import Array
from .tree import Link, Tree

Fix = Literal["", "nearest"]
"""What is done about an inertia that no body can have and that a joint feels: refused, or replaced by the nearest."""

_KEYS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def checked_bodies(path: Path, tree: Tree, odd: Mapping[str, Array], fix: Fix = "") -> Tree:
    """The tree, its bodies ones that can be; notes say what was odd in the file and does not matter.

    Parameters
    ----------
    path : Path
        The robot's file, for messages.
    tree : Tree
        With all that is welded together added up.
    odd : mapping of str to array (10,)
        Links of the file whose own inertia about their centre of mass no body can have.
    fix : "" or "nearest"

    Raises
    ------
    InputError
        A moving body that no body can be, without ``fix``; no joint moves a mass.
    """
    tree = _without_weightless(path, tree)
    wrong = [link for link in tree.links if not inertia.is_physical(link.phi)]
    if wrong and not fix:
        _refuse(path, wrong[0], odd)
    notes = list(tree.notes)
    if wrong:
        names = [link.name for link in wrong]
        notes.append(f"inertia_fix: {_some(names)} had an inertia that no body can have; the nearest possible is taken")
    unfelt = [name for name in odd if name not in {link.name for link in wrong}]
    if unfelt:
        notes.append(
            f"{path.name}: the inertia of {_some(unfelt)} is one that no body can have; no joint feels it (it stands "
            "on the base, or is welded to a body whose sum is possible)"
        )
    mended = tuple(
        Link(link.name, inertia.nearest_physical(*inertia.to_central(link.phi))) if link in wrong else link
        for link in tree.links
    )
    return replace(tree, links=mended, notes=tuple(notes))


def _some(names: Sequence[str], most: int = 5) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")


def _refuse(path: Path, link: Link, odd: Mapping[str, Array]) -> None:
    """Say what is wrong with an inertia and what the nearest possible one is, ready to paste."""
    if link.phi[0] <= 0:
        raise InputError(
            f"{path}: link '{link.name}' has mass {link.phi[0]:g} kg and an inertia; give it a mass above 0, or no "
            "<inertial>"
        )
    name, phi = (link.name, odd[link.name]) if link.name in odd else (link.name, link.phi)
    mass, _, matrix = inertia.to_central(phi)
    small, middle, large = np.linalg.eigvalsh(matrix)
    fault = f"{small:.6g} is negative" if small < 0 else f"{large:.6g} > {small:.6g} + {middle:.6g}"
    nearest = inertia.nearest_physical(mass, np.zeros(3), matrix)[4:]
    scale = np.abs(nearest).max() * 1e-12
    paste = " ".join(f'{key}="{0.0 if abs(x) < scale else x:.12g}"' for key, x in zip(_KEYS, nearest, strict=True))
    raise InputError(
        f"{path}: link '{name}' has an inertia that no body can have: principal moments "
        f'{small:.6g}, {middle:.6g}, {large:.6g} kg·m² ({fault}); correct it, write inertia_fix = "nearest" into the '
        f"model file, or take the nearest possible one: <inertia {paste}/>"
    )


def _without_weightless(path: Path, tree: Tree) -> Tree:
    """The tree without joints that move no mass: their motion takes no torque, and is felt nowhere.

    They are held, and stand among ``weightless``. Where no joint moves any mass, that is refused.
    """
    masses = [float(link.phi[0]) for link in tree.links]
    felt = np.zeros(tree.n_joints)
    for i, (joint, leader, _, _) in reversed(list(enumerate(tree.bodies))):
        felt[leader] += masses[i]
        if joint.parent >= 0:
            masses[joint.parent] += masses[i]
    names = tuple(joint.name for joint, mass in zip(tree.joints, felt, strict=True) if mass <= 0)
    if len(names) == tree.n_joints:
        raise InputError(
            f"{path}: joint '{names[-1]}' moves no mass: link '{tree.links[tree.n_joints - 1].name}' and all beyond it "
            "have none; give one an <inertial>"
        )
    if not names:
        return tree
    note = f"{path.name}: {_some(names)} moves no mass and is held; give a link beyond an <inertial> if it should move"
    return replace(hold(tree, dict.fromkeys(names, 0.0)), weightless=names, notes=(*tree.notes, note))
