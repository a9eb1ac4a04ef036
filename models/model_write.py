"""Model files (TOML) written: what is believed of a system, with what was found."""

import json
import os
from pathlib import Path
from typing import Any

from ..files import written_whole
from ..recordings.mixes import signal_fields
from .docking.bench_setup import DockingTree
from .empirical import NAME, empirical_tables, of_a_table, tables_of
from .floating.tree import FloatingTree
from .holding import Holding
from .model import Model, PlacedEffect, places
from .model_comments import with_comments
from .rig.file import sling_table
from .rig.rig import Rig
from .servo import servo_fields
from .snare.setup import SnareTree
from .transmission import transmission_fields


def save_model(model: Model, path: str | Path, note: str) -> None:
    """Write a model file that `load_model` reads back, all or nothing.

    Comments of the file that the model was read from stay. ``effects`` lists an effect by its name alone
    where it acts at every place, as ``{ name, at, hold }`` where it does not.
    """
    path = Path(path)
    by_name: dict[str, list[PlacedEffect]] = {}
    tables = empirical_tables(model.effects, model.values)
    for placed in [p for p in model.effects if not tables_of(p.effect)]:
        by_name.setdefault(placed.effect.name, []).append(placed)
    listed = []
    for name, members in by_name.items():
        everywhere = sorted(p.at for p in members) == sorted(places(members[0].effect, model.tree))
        if everywhere and not any(p.hold for p in members):
            listed.append(toml_text(name))
            continue
        for p in members:
            hold = f", hold = {toml_text(list(p.hold))}" if p.hold else ""
            listed.append(f"{{ name = {toml_text(name)}, at = {toml_text(p.at)}{hold} }}")
    lines = [f"# {line}" for line in note.splitlines()]
    lines += [
        f"name = {toml_text(model.name)}",
        f"system = {toml_text(model.system)}",
        *(
            []
            if model.urdf is None
            else [f"urdf = {toml_text(Path(os.path.relpath(model.urdf, path.parent)).as_posix())}"]
        ),
        f"gravity = {toml_text([float(g) for g in model.tree.gravity])}",
        f"inertia = {toml_text(model.inertia)}",
        "effects = [",
        *(f"    {entry}," for entry in listed),
        "]",
    ]
    if model.bandwidth is not None:
        lines.append(f"bandwidth = {toml_text(model.bandwidth)}")
    if isinstance(model.tree, FloatingTree):
        lines.append(f"base = {toml_text(model.tree.body)}")
    lines += holding_lines(model.holding)
    lines += [f"breaks = {toml_text(list(model.cuts.breaks))}"] if model.cuts.breaks else []
    lines += [f"limits = {toml_text(dict(model.cuts.limits))}"] if model.cuts.limits else []
    if isinstance(model.tree, Rig) and model.urdf is not None:
        lines += ["", "[slings]"]
        for name, fields in sling_table(model.tree).items():
            lines.append(f"{toml_text(name)} = {{ {', '.join(f'{k} = {toml_text(v)}' for k, v in fields.items())} }}")
    if isinstance(model.tree, SnareTree) and model.tree.setup.given:
        lines += ["", "[capture]", *(f"{k} = {toml_text(v)}" for k, v in model.tree.setup.given.items())]
    if isinstance(model.tree, DockingTree) and model.tree.setup.given:
        lines += ["", "[docking]", *(f"{k} = {toml_text(v)}" for k, v in model.tree.setup.given.items())]
    if model.signals:
        lines += ["", "[signals]"]
        for name, signal in model.signals.items():
            lines.append(f"{toml_text(name)} = {toml_text(signal_fields(signal))}")
    if model.servo:
        lines += ["", "[servo]", *(f"{toml_text(j)} = {toml_text(servo_fields(s))}" for j, s in model.servo.items())]
    if model.transmission is not None:
        fields = transmission_fields(model.transmission)
        lines += ["", "[transmission]", *(f"{key} = {toml_text(value)}" for key, value in fields.items())]
    motors = () if model.transmission is None else model.transmission.motors
    axes = [axis for axis in model.tree.axes if axis.name not in motors]
    if axes:
        lines += ["", "[axes]", *(f"{toml_text(a.name)} = {toml_text(dict(a.along))}" for a in axes)]
    values = {k: v for k, v in model.values.items() if not of_a_table(k)}
    if values:
        lines += ["", "[parameters]", *(f"{toml_text(k)} = {float(v)!r}" for k, v in values.items())]
    for table in tables:
        lines += ["", f"[[{NAME}]]", *(f"{k} = {toml_text(v)}" for k, v in table.items())]
    with written_whole(path, "choose a folder that exists") as part:
        part.write_text(with_comments(model.path, "\n".join(lines) + "\n"), encoding="utf-8")


def holding_lines(holding: Holding) -> list[str]:
    """Lines of a model file that say which joints move, which are held where, and what inertias are mended."""
    lines = []
    if holding.joints is not None:
        lines.append(f"joints = {toml_text(list(holding.joints))}")
    if holding.locked:
        lines.append(
            f"locked = {{ {', '.join(f'{toml_text(k)} = {toml_text(v)}' for k, v in holding.locked.items())} }}"
        )
    return lines + ([f"inertia_fix = {toml_text(holding.fix)}"] if holding.fix else [])


def toml_text(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for one character that TOML wants escaped too.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(toml_text(v) for v in value) + "]"
    if isinstance(value, dict):
        return (
            "{ "
            + ", ".join(
                f"{k if k.isidentifier() and k.isascii() else toml_text(k)} = {toml_text(v)}" for k, v in value.items()
            )
            + " }"
        )
    return repr(float(value)) if isinstance(value, float) else repr(value)  # NumPy's floats show their type
