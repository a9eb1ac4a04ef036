"""The ``[slings]`` table of a model file: which body each sling holds, where, and with what weight."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..inertia import Array, to_central
from ..tree import Tree
from .rig import Rig, Sling

_KEYS = ("body", "point", "weight", "hardware", "slide")


def read_slings(path: Path, table: Any, tree: Tree) -> Rig:
    """An arm and its ``[slings]`` table as a rig.

    Parameters
    ----------
    path : Path
        The model file, for messages.
    table : any
        ``{name: {body = "...", point = [x, y, z], weight = N, hardware = N, slide = [[x, y, z], ...]}}``. Only ``body``
        is a must: the point is else the body's centre of mass, the weight an equal share of what the body's other
        slings leave, the hardware's weight zero, and there is no slide.
    tree : Tree
        The arm.

    Raises
    ------
    InputError
        Where the table is missing, a key or value is not as above, or slings carry more than their body weighs.
    """
    if not isinstance(table, dict) or not table:
        raise InputError(
            f'{path}: [slings] is missing; a rig with a URDF needs it: "name" = {{ body = ..., point = [x, y, z] }}'
        )
    bodies = [link.name for link in tree.links]
    entries: dict[str, Mapping[str, Any]] = {}
    for name, entry in table.items():
        if not isinstance(entry, dict) or entry.get("body") not in bodies:
            raise InputError(
                f"{path}: [slings] {name} = {entry!r}; allowed is {{ body = ..., point = [x, y, z] }} "
                f"with a body of {', '.join(bodies)}"
            )
        for key in set(entry) - set(_KEYS):
            raise InputError(f"{path}: [slings] {name} has {key!r}; allowed are {', '.join(_KEYS)}")
        entries[name] = entry
    bare = Rig(tree.name, tree.joints, tree.links, tree.gravity, followers=tree.followers, notes=tree.notes)
    slings = []
    for name, entry in entries.items():
        link = bodies.index(entry["body"])
        mass, com, _ = to_central(tree.links[link].phi)
        point = _rows(path, name, "point", [entry["point"]])[0] if "point" in entry else com
        contacts = _rows(path, name, "slide", entry.get("slide", []))
        if "weight" in entry:
            weight = _weight(path, name, entry, "weight")
        else:
            weight = _share(path, entries, entry["body"], -mass * float(tree.gravity[2]))
        slings.append(Sling(name, link, point, weight, _weight(path, name, entry, "hardware"), contacts))
    return replace(bare, slings=tuple(slings))


def sling_table(rig: Rig) -> dict[str, dict[str, Any]]:
    """The table that `read_slings` reads back."""
    return {
        s.name: {"body": rig.links[s.link].name, "point": s.point.tolist(), "weight": s.weight, "hardware": s.hardware}
        | ({"slide": s.slide.tolist()} if len(s.slide) else {})
        for s in rig.slings
    }


def _share(path: Path, entries: Mapping[str, Mapping[str, Any]], body: str, whole: float) -> float:
    """Equal share [N] of what a body's slings with a weight of their own leave of its whole weight."""
    own = {name: e for name, e in entries.items() if e["body"] == body}
    given = sum(_weight(path, name, e, "weight") for name, e in own.items())
    if given > whole:
        raise InputError(
            f"{path}: [slings] give {given:.6g} N to the slings of {body!r}, which weighs {whole:.6g} N; "
            f"leave something for {next(n for n, e in own.items() if 'weight' not in e)!r}, or give its weight"
        )
    return (whole - given) / sum("weight" not in e for e in own.values())


def _weight(path: Path, name: str, entry: Mapping[str, Any], key: str) -> float:
    value = entry.get(key, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < np.inf:
        raise InputError(f"{path}: [slings] {name} {key} = {value!r}; allowed is a number of newtons, zero or more")
    return float(value)


def _rows(path: Path, name: str, key: str, value: Any) -> Array:
    rows = value if isinstance(value, list) else [value]
    for row in rows:
        good = isinstance(row, list) and len(row) == 3
        if not good or any(isinstance(x, bool) or not isinstance(x, int | float) or not np.isfinite(x) for x in row):
            form, shown = ("three numbers [m]", value[0]) if key == "point" else ("a list of points [m]", value)
            raise InputError(f"{path}: [slings] {name} {key} = {shown!r}; allowed is {form}")
    return np.array(rows, float).reshape(len(rows), 3)
