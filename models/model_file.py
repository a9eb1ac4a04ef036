"""Model files (TOML): what is believed of a system, read with every mistake named, and written with what was found."""

import difflib
import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..recordings.signals import FORMS, Signal, is_signal, joint_of
from .effect import Effect
from .effects import get_effect
from .floating_tree import FloatingTree, n_carriers, read_floating
from .hidden_state import rows
from .rig import Rig, built_in_rig
from .rig_file import read_slings, sling_table
from .rig_kinematics import booms, reached_joints, slides
from .tree import Tree
from .urdf import load_urdf

SYSTEMS = ("arm", "zero_g_rig", "free_floating_arm")
"""Systems that this version can fit; the format reserves snare_capture."""

_KEYS = (
    "name",
    "system",
    "urdf",
    "base",
    "gravity",
    "inertia",
    "effects",
    "slings",
    "signals",
    "bandwidth",
    "parameters",
)


@dataclass(frozen=True)
class Placed:
    """An effect and the one place it acts at: a joint, a link, a sling, or a sensor channel such as ``tau.joint1``.

    Parameters named in ``hold`` are not identified: the recordings did not ask for them, or another effect carries
    them.
    """

    effect: Effect
    at: str
    hold: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """``effect.at``, by which parameters are stored."""
        return f"{self.effect.name}.{self.at}"


@dataclass(frozen=True)
class Model:
    """A model file, read and checked.

    Parameters
    ----------
    path : Path
        The file.
    name, system : str
    urdf : Path or None
        None for the built-in rig, and for the built-in ETS-VII.
    tree : Tree
        Joints, links, nominal inertia and gravity; a `Rig` for ``zero_g_rig``, with its slings; a `FloatingTree` for
        ``free_floating_arm``, whose first six joints carry the base.
    inertia : "fixed" or "free"
    effects : tuple of Placed
        Physics that the model has, one entry a place.
    signals : mapping of str to Signal
        Where a recording with columns of its own has each signal.
    bandwidth : float or None
        Edge of the analysis band [Hz]; None: chosen from the recordings.
    values : mapping of str to float
        Parameters known so far, by ``effect.at.parameter`` (``inertia.<link>.<parameter>`` for inertial parameters).
    """

    path: Path
    name: str
    system: str
    urdf: Path | None
    tree: Tree
    inertia: str
    effects: tuple[Placed, ...]
    signals: Mapping[str, Signal]
    bandwidth: float | None
    values: Mapping[str, float]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joint names in order."""
        return tuple(j.name for j in self.tree.joints)

    def with_effects(self, added: Sequence[Placed], values: Mapping[str, float]) -> "Model":
        """The model with more effects, and with parameters that a fit found."""
        return replace(self, effects=(*self.effects, *added), values={**self.values, **values})


def places(effect: Effect, tree: Tree) -> tuple[str, ...]:
    """Places of a tree at which an effect can act on some torque; sensor effects act on torque channels by default."""
    carriers = n_carriers(tree)
    if effect.at == "joint":
        return tuple(j.name for j in tree.joints[carriers:])
    if effect.at == "link":
        return tuple(link.name for link in tree.links[max(carriers - 1, 0) :])
    if effect.at == "base":
        return ("base",) if carriers else ()
    if effect.at != "sensor":
        if not isinstance(tree, Rig):
            return ()
        every = {"sling": tuple(s.name for s in tree.slings), "slide": slides(tree), "boom": booms(tree)}[effect.at]
        return tuple(at for at in every if reached_joints(tree, effect.at, at, rows(effect)))
    return tuple(f"tau.{j.name}" for j in tree.joints[carriers:])


def load_model(path: str | Path) -> Model:
    """Read a model file.

    Raises
    ------
    InputError
        Missing file, broken TOML, an unknown key, system, effect or place, a value of the wrong kind.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such model file")
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}; mend that line") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the file's permissions") from None
    for key in raw:
        if key not in _KEYS:
            near = difflib.get_close_matches(key, _KEYS, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise InputError(f"{path}: unknown key {key!r}; allowed are {', '.join(_KEYS)}{hint}")
    system = _text(path, raw, "system", "arm")
    if system not in SYSTEMS:
        raise InputError(f"{path}: system {system!r} cannot be fitted by this version; allowed: {', '.join(SYSTEMS)}")
    inertia = _text(path, raw, "inertia", "fixed")
    if inertia not in ("fixed", "free"):
        raise InputError(f"{path}: inertia = {inertia!r}; allowed are 'fixed' and 'free'")
    usual = [0.0, 0.0, 0.0 if system == "free_floating_arm" else -9.81]
    gravity = _numbers(path, raw.get("gravity", usual), "gravity", 3)
    bandwidth = raw.get("bandwidth")
    number = isinstance(bandwidth, int | float) and not isinstance(bandwidth, bool)
    if bandwidth is not None and not (number and 0 < bandwidth < np.inf):
        raise InputError(f"{path}: bandwidth = {bandwidth!r}; allowed is a positive number of hertz")
    urdf = path.parent / _text(path, raw, "urdf", "") if "urdf" in raw else None
    tree = _tree(path, raw, system, urdf, gravity)
    return Model(
        path,
        _text(path, raw, "name", path.stem),
        system,
        urdf,
        tree,
        inertia,
        _placed(path, raw.get("effects", []), tree),
        _signals(path, raw.get("signals", {}), tree),
        None if bandwidth is None else float(bandwidth),
        _values(path, raw.get("parameters", {})),
    )


def _tree(path: Path, raw: Mapping[str, Any], system: str, urdf: Path | None, gravity: Sequence[float]) -> Tree:
    """The arm of a model file, on its slings where the system is a rig."""
    if "slings" in raw and (system != "zero_g_rig" or urdf is None):
        raise InputError(f"{path}: [slings] belong to system = 'zero_g_rig' with a URDF of your own; take them out")
    if system == "free_floating_arm":
        try:
            return read_floating(urdf, tuple(gravity), _text(path, raw, "base", "base"))
        except InputError as error:
            raise InputError(str(error) if str(error).startswith(str(urdf)) else f"{path}: {error}") from None
    if "base" in raw:
        raise InputError(f"{path}: key 'base' belongs to system = 'free_floating_arm'; take it out")
    if urdf is not None:
        tree = load_urdf(urdf, tuple(gravity))
        if system != "zero_g_rig":
            return tree
    elif system != "zero_g_rig":
        raise InputError(f"{path}: key 'urdf' is missing; name the URDF, relative to this file")
    try:
        return built_in_rig(gravity) if urdf is None else read_slings(path, raw.get("slings"), tree)
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


def save_model(model: Model, path: str | Path, note: str) -> None:
    """Write a model file that `load_model` reads back, all or nothing.

    ``effects`` lists an effect by its name alone where it acts at every place, as ``{ name, at, hold }`` where it
    does not.
    """
    path = Path(path)
    by_name: dict[str, list[Placed]] = {}
    for placed in model.effects:
        by_name.setdefault(placed.effect.name, []).append(placed)
    listed = []
    for name, members in by_name.items():
        everywhere = sorted(p.at for p in members) == sorted(places(get_effect(name), model.tree))
        if everywhere and not any(p.hold for p in members):
            listed.append(_toml(name))
            continue
        for p in members:
            hold = f", hold = {_toml(list(p.hold))}" if p.hold else ""
            listed.append(f"{{ name = {_toml(name)}, at = {_toml(p.at)}{hold} }}")
    lines = [f"# {line}" for line in note.splitlines()]
    lines += [
        f"name = {_toml(model.name)}",
        f"system = {_toml(model.system)}",
        *([] if model.urdf is None else [f"urdf = {_toml(Path(os.path.relpath(model.urdf, path.parent)).as_posix())}"]),
        f"gravity = {_toml([float(g) for g in model.tree.gravity])}",
        f"inertia = {_toml(model.inertia)}",
        "effects = [",
        *(f"    {entry}," for entry in listed),
        "]",
    ]
    if model.bandwidth is not None:
        lines.append(f"bandwidth = {_toml(model.bandwidth)}")
    if isinstance(model.tree, FloatingTree):
        lines.append(f"base = {_toml(model.tree.body)}")
    if isinstance(model.tree, Rig) and model.urdf is not None:
        lines += ["", "[slings]"]
        for name, fields in sling_table(model.tree).items():
            lines.append(f"{_toml(name)} = {{ {', '.join(f'{k} = {_toml(v)}' for k, v in fields.items())} }}")
    if model.signals:
        lines += ["", "[signals]"]
        for name, signal in model.signals.items():
            fields = {"column": signal.column, "unit": signal.unit, "gain": signal.gain}
            inner = ", ".join(f"{k} = {_toml(v)}" for k, v in fields.items() if v is not None)
            lines.append(f"{_toml(name)} = {{ {inner} }}")
    if model.values:
        lines += ["", "[parameters]", *(f"{_toml(k)} = {float(v)!r}" for k, v in model.values.items())]
    scratch = path.with_name(path.name + ".part")
    try:
        scratch.write_text("\n".join(lines) + "\n", encoding="utf-8")
        scratch.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror}; choose a folder that exists") from None
    finally:
        with suppress(OSError):
            scratch.unlink()


def _toml(value: Any) -> str:
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for one character that TOML wants escaped too.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(float(value)) if isinstance(value, float) else repr(value)  # NumPy's floats show their type


def _text(path: Path, raw: Mapping[str, Any], key: str, default: str) -> str:
    value = raw.get(key, default)
    if not isinstance(value, str):
        raise InputError(f"{path}: {key} = {value!r}; allowed is text in quotes")
    return value


def _numbers(path: Path, value: Any, key: str, count: int) -> list[float]:
    good = isinstance(value, list) and len(value) == count
    if not good or any(isinstance(v, bool) or not isinstance(v, int | float) or not np.isfinite(v) for v in value):
        raise InputError(f"{path}: {key} = {value!r}; allowed is a list of {count} numbers")
    return [float(v) for v in value]


def _placed(path: Path, entries: Any, tree: Tree) -> tuple[Placed, ...]:
    if not isinstance(entries, list):
        raise InputError(f"{path}: effects = {entries!r}; allowed is a list of effect names")
    found: list[Placed] = []
    for entry in entries:
        name = entry.get("name") if isinstance(entry, dict) else entry
        if not isinstance(name, str):
            raise InputError(f"{path}: effects has {entry!r}; allowed is a name, or {{ name = ..., at = ... }}")
        try:
            effect = get_effect(name)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        everywhere = places(effect, tree)
        if not everywhere:
            raise InputError(f"{path}: {name} acts at a {effect.at}, and this model has none; take it out")
        extra = set(entry) - {"name", "at", "hold"} if isinstance(entry, dict) else set()
        if extra:
            raise InputError(f"{path}: effects: {name} has {sorted(extra)[0]!r}; allowed are name, at, hold")
        at = entry.get("at") if isinstance(entry, dict) else None
        allowed = everywhere
        if effect.at == "sensor" and effect.states:
            # A late position shows as an early torque; what else an encoder does would be read as torque.
            allowed += tuple(f"q.{j.name}" for j in tree.joints)
        if at is not None and at not in allowed:
            raise InputError(f"{path}: {name} at {at!r}; this model has {', '.join(allowed)}")
        hold = entry.get("hold", []) if isinstance(entry, dict) else []
        names = [p.name for p in effect.parameters]
        if not isinstance(hold, list) or any(h not in names for h in hold):
            raise InputError(f"{path}: {name} hold = {hold!r}; allowed is a list of {', '.join(names)}")
        found += [Placed(effect, place, tuple(hold)) for place in ((at,) if at else everywhere)]
    keys = [p.key for p in found]
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(f"{path}: {key} is listed twice in effects; keep one")
    return tuple(found)


def _signals(path: Path, table: Any, tree: Tree) -> dict[str, Signal]:
    if not isinstance(table, dict):
        raise InputError(f"{path}: [signals] must be a table of name = {{ column = ... }}")
    signals, joints = {}, [j.name for j in tree.joints]
    for name, entry in table.items():
        if not is_signal(name):
            raise InputError(f"{path}: {name!r} in [signals] is not a signal's name; allowed are {FORMS}")
        joint = joint_of(name)
        if joint is not None and joint not in joints:
            raise InputError(f"{path}: {name!r} in [signals]: the URDF has no such joint, only {', '.join(joints)}")
        slings = [f"tension.{s.name}" for s in tree.slings] if isinstance(tree, Rig) else [name]
        if name.startswith("tension.") and name not in slings:
            raise InputError(f"{path}: {name!r} in [signals]: the rig has no such sling, only {', '.join(slings)}")
        fields = {"column": entry} if isinstance(entry, str) else entry
        if not isinstance(fields, dict) or not isinstance(fields.get("column"), str):
            raise InputError(
                f"{path}: [signals] {name} = {entry!r}; allowed is {{ column = ..., unit = ..., gain = ... }}"
            )
        extra = set(fields) - {"column", "unit", "gain"}
        if extra:
            raise InputError(f"{path}: [signals] {name} has {sorted(extra)[0]!r}; allowed are column, unit, gain")
        if not isinstance(fields.get("unit"), str | None):
            raise InputError(f"{path}: [signals] {name} unit = {fields['unit']!r}; allowed is text in quotes")
        gain = fields.get("gain")
        if isinstance(gain, bool) or not isinstance(gain, int | float | str | None):
            raise InputError(f"{path}: [signals] {name} gain = {gain!r}; allowed is a number or a scalar's name")
        signals[name] = Signal(fields["column"], fields.get("unit"), gain)
    return signals


def _values(path: Path, table: Any) -> dict[str, float]:
    if not isinstance(table, dict):
        raise InputError(f'{path}: [parameters] must be a table of "effect.place.parameter" = number')
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise InputError(f"{path}: [parameters] {name} = {value!r}; allowed is a finite number")
    return {k: float(v) for k, v in table.items()}
