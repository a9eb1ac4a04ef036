"""Model files (TOML) read, with every mistake named."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, nearest, unknown_key
from ..files import toml_table
from ..recordings.cuts import read_cuts
from ..recordings.mixes import read_signal
from ..recordings.read import SUFFIXES
from ..recordings.signals import FORMS, FREE, Signal, is_signal, joint_of
from .axes import neighbours, read_axes
from .docking.bench_setup import read_bench
from .effects import get_effect
from .empirical import read_empirical
from .floating.tree import UNNAMED, read_floating
from .holding import Holding, read_holding
from .model import Model, PlacedEffect, effect_on, places
from .published_inertia import Fix
from .rig.file import read_slings
from .rig.rig import Rig, built_in_rig
from .servo import read_servo
from .snare.setup import read_setup
from .transmission import Transmission, read_transmission
from .tree import Tree
from .urdf import load_urdf

SYSTEMS = ("arm", "zero_g_rig", "free_floating_arm", "snare_capture", "docking")
"""Systems that this version can fit."""

_GRAVITY = {"free_floating_arm": [0.0, 0.0, 0.0], "snare_capture": [-9.81, 0.0, 0.0], "docking": [0.0, 0.0, 0.0]}
_TABLES = {"snare_capture": "capture", "docking": "docking"}
"""Systems whose set-up is a table of its own, without a URDF."""

"""[m/s²], where it is not given: the paper's ground test hangs along the snare's axis."""

_KEYS = (
    "name",
    "system",
    "urdf",
    "base",
    "gravity",
    "inertia",
    "joints",
    "locked",
    "inertia_fix",
    "breaks",
    "limits",
    "effects",
    "slings",
    "capture",
    "docking",
    "signals",
    "servo",
    "transmission",
    "axes",
    "bandwidth",
    "parameters",
    "empirical",
)


def load_model(path: str | Path, fix: Fix = "") -> Model:
    """Read a model file; ``fix`` replaces impossible inertias of moving bodies, unless the file says how itself.

    Raises
    ------
    InputError
        Missing file, broken TOML, an unknown key, system, effect or place, a value of the wrong kind.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such model file; {_neighbour(path, '.toml') or 'check the path'}")
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path}: is a recording by its suffix; the model file (TOML) comes first, then recordings")
    raw = toml_table(path)
    for key in raw:
        if key not in _KEYS:
            raise unknown_key(path, key, _KEYS)
    system = _text(path, raw, "system", "arm")
    if system not in SYSTEMS:
        raise InputError(f"{path}: system {system!r} cannot be fitted by this version; allowed: {', '.join(SYSTEMS)}")
    inertia = _text(path, raw, "inertia", "fixed")
    if inertia not in ("fixed", "free"):
        raise InputError(f"{path}: inertia = {inertia!r}; allowed are 'fixed' and 'free'")
    usual = _GRAVITY.get(system, [0.0, 0.0, -9.81])
    gravity = _numbers(path, raw.get("gravity", usual), "gravity", 3)
    bandwidth = raw.get("bandwidth")
    number = isinstance(bandwidth, int | float) and not isinstance(bandwidth, bool)
    if bandwidth is not None and not (number and 0 < bandwidth < np.inf):
        raise InputError(f"{path}: bandwidth = {bandwidth!r}; allowed is a positive number of hertz")
    if system in _TABLES:
        for key, instead in (("urdf", f"[{_TABLES[system]}] has its sizes"), ("bandwidth", "recordings have none")):
            if key in raw:
                raise InputError(f"{path}: system = {system!r} has no {key}, {instead}; take it out")
        if inertia != "fixed":
            raise InputError(f"{path}: inertia = {inertia!r}; system = {system!r} allows 'fixed' only")
    if system == "docking" and any(gravity):
        raise InputError(f"{path}: gravity = {gravity}; a docking test hangs balanced: take it out")
    for owner, table in _TABLES.items():
        if table in raw and owner != system:
            raise InputError(f"{path}: [{table}] belongs to system = {owner!r}; take it out")
    urdf = path.parent / _text(path, raw, "urdf", "") if "urdf" in raw else None
    if urdf is not None and _missing(urdf):
        hint = _neighbour(urdf, ".urdf") or "check the path, which starts where the model file is"
        raise InputError(f"{path}: urdf = {raw['urdf']!r}: no such file; {hint}")
    holding = read_holding(path, raw, system)
    holding = replace(holding, fix=holding.fix or fix)
    tree = _tree(path, raw, system, urdf, gravity, holding)
    for key in ("servo", "transmission", "axes"):
        if key in raw and type(tree) is not Tree:
            raise InputError(f"{path}: [{key}] belongs to system = 'arm'; take it out")
    transmission = read_transmission(path, raw, tree.joints)
    axes = read_axes(path, raw, tree.joints)
    motors = () if transmission is None else transmission.axes(tree.joints)
    twice = {axis.name for axis in axes} & {motor.name for motor in motors}
    if twice:
        raise InputError(f"{path}: {sorted(twice)[0]!r} is an axis and a motor; give each a name of its own")
    tree = replace(tree, axes=(*axes, *motors))
    servo = read_servo(path, raw, [joint.name for joint in tree.joints])
    signals = _signals(path, raw.get("signals", {}), tree, holding, transmission)
    tables, table_values = read_empirical(path, raw, tree, system)
    model = Model(
        path,
        _text(path, raw, "name", path.stem),
        system,
        urdf,
        tree,
        inertia,
        (*_placed(path, raw.get("effects", []), tree), *tables),
        signals,
        None if bandwidth is None else float(bandwidth),
        _values(path, raw.get("parameters", {})) | table_values,
        holding,
        read_cuts(path, raw, [f"tau.{joint.name}" for joint in tree.joints]),
        servo,
        transmission,
    )
    _demand_one_reading(model)
    return model


def _demand_one_reading(model: Model) -> None:
    """Refuse a torque that is read in two ways, and constants that are no more to be told apart (InputError)."""
    path = model.path
    free = {name for name, s in model.signals.items() if s.gain == FREE}
    for joint, servo in model.servo.items():
        if f"tau.{joint}" in model.signals:
            raise InputError(f"{path}: 'tau.{joint}' is in [signals] and worked out by [servo]; keep one of them")
        free |= {f"tau.{joint}"} if servo.stiffness is None else set()
    for p in model.effects:
        if p.effect.name == "sensor_gain" and p.at in free:
            raise InputError(f"{path}: sensor_gain at {p.at}, whose constant is free already; keep one of them")
    torques = [f"tau.{j}" for j in model.joints]
    driven = [name for name in torques if name not in model.signals or not model.signals[name].nothing]
    if model.inertia == "free" and free and free >= set(driven):
        raise InputError(
            f"{path}: inertia = 'free' and every torque's constant free: masses, friction and constants can all grow "
            "together; give one constant as a number, or inertia = 'fixed'"
        )


def _missing(path: Path) -> bool:
    """Whether there is nothing; what cannot even be looked for is left to who reads it."""
    try:
        return not path.exists()
    except (OSError, ValueError):  # a name that is too long, or a folder that is closed
        return False


def _neighbour(path: Path, suffix: str) -> str:
    """In words, the file in the same folder that is spelled most like it and has this suffix; empty without one."""
    try:
        near = nearest(path.name, (p.name for p in path.parent.glob(f"*{suffix}") if p.is_file()))
    except (OSError, ValueError):
        return ""
    return f"nearest is {near!r}" if near else ""


def _tree(
    path: Path, raw: Mapping[str, Any], system: str, urdf: Path | None, gravity: Sequence[float], holding: Holding
) -> Tree:
    """The arm of a model file, on its slings where the system is a rig."""
    if "slings" in raw and (system != "zero_g_rig" or urdf is None):
        raise InputError(f"{path}: [slings] belong to system = 'zero_g_rig' with a URDF of your own; take them out")
    if system in _TABLES:
        if "base" in raw:
            raise InputError(f"{path}: key 'base' belongs to system = 'free_floating_arm'; take it out")
        name = _text(path, raw, "name", path.stem)
        if system == "docking":
            return read_bench(path, name, raw.get("docking"))
        return read_setup(path, name, raw.get("capture"), list(gravity))
    if system == "free_floating_arm":
        try:
            return read_floating(urdf, tuple(gravity), _text(path, raw, "base", UNNAMED))
        except InputError as error:
            raise InputError(str(error) if str(error).startswith(str(urdf)) else f"{path}: {error}") from None
    if "base" in raw:
        raise InputError(f"{path}: key 'base' belongs to system = 'free_floating_arm'; take it out")
    if urdf is not None:
        tree = load_urdf(urdf, tuple(gravity), held=holding.locked, moving=holding.joints, fix=holding.fix)
        if system != "zero_g_rig":
            return tree
    elif system != "zero_g_rig":
        raise InputError(f"{path}: key 'urdf' is missing; name the URDF, relative to this file")
    try:
        return built_in_rig(gravity) if urdf is None else read_slings(path, raw.get("slings"), tree)
    except InputError as error:
        raise InputError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None


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


def _placed(path: Path, entries: Any, tree: Tree) -> tuple[PlacedEffect, ...]:
    if not isinstance(entries, list):
        raise InputError(f"{path}: effects = {entries!r}; allowed is a list of effect names")
    found: list[PlacedEffect] = []
    for entry in entries:
        name = entry.get("name") if isinstance(entry, dict) else entry
        if not isinstance(name, str):
            raise InputError(f"{path}: effects has {entry!r}; allowed is a name, or {{ name = ..., at = ... }}")
        try:
            effect = effect_on(get_effect(name), tree)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        everywhere = places(effect, tree)
        if not everywhere:
            raise InputError(f"{path}: {name} acts at a {effect.at}, and this model has none; take it out")
        extra = set(entry) - {"name", "at", "hold"} if isinstance(entry, dict) else set()
        if extra:
            raise InputError(f"{path}: effects: {name} has {sorted(extra)[0]!r}; allowed are name, at, hold")
        at = entry.get("at") if isinstance(entry, dict) else None
        allowed, encoded = everywhere, tree.joints[tree.carriers :]
        if effect.at == "sensor" and effect.states and not effect.leads:
            # A late position shows as an early torque; what else an encoder does would be read as torque.
            allowed += tuple(f"q.{j.name}" for j in encoded)
        if effect.at == "sensor" and not effect.leads:
            allowed += tuple(f"q_link.{j.name}" for j in encoded)
        if effect.at == "joint" and effect.acts_on == "torque":
            allowed += tuple(axis.name for axis in (*tree.axes, *neighbours(tree, tree.carriers)))
        if at is not None and at not in allowed:
            raise InputError(f"{path}: {name} at {at!r}; this model has {', '.join(allowed)}")
        hold = entry.get("hold", []) if isinstance(entry, dict) else []
        names = [p.name for p in effect.parameters]
        if not isinstance(hold, list) or any(h not in names for h in hold):
            raise InputError(f"{path}: {name} hold = {hold!r}; allowed is a list of {', '.join(names)}")
        found += [PlacedEffect(effect, place, tuple(hold)) for place in ((at,) if at else everywhere)]
    for key, count in Counter(p.key for p in found).items():
        if count > 1:
            raise InputError(f"{path}: {key} is listed twice in effects; keep one")
    return tuple(found)


def _signals(
    path: Path, table: Any, tree: Tree, holding: Holding, transmission: Transmission | None
) -> dict[str, Signal]:
    if not isinstance(table, dict):
        raise InputError(f"{path}: [signals] must be a table of name = {{ column = ... }}")
    signals, joints = {}, [j.name for j in tree.joints]
    motors = () if transmission is None else transmission.motors
    for name, entry in table.items():
        if not is_signal(name):
            raise InputError(f"{path}: {name!r} in [signals] is not a signal's name; allowed are {FORMS}")
        joint = joint_of(name)
        if joint in holding.locked or joint in tree.weightless:
            continue  # a joint that is held has no signals, wherever they would be
        if joint in motors and name.partition(".")[0] not in ("q", "tau"):
            raise InputError(f"{path}: {name!r} in [signals]: of a motor q and tau are read; take it out")
        if joint is not None and joint not in joints and joint not in motors:
            raise InputError(
                f"{path}: {name!r} in [signals]: the URDF has no such joint, only {', '.join(joints)}; did you mean "
                f"{nearest(joint, joints)!r}?"
            )
        slings = [f"tension.{s.name}" for s in tree.slings] if isinstance(tree, Rig) else [name]
        if name.startswith("tension.") and name not in slings:
            raise InputError(f"{path}: {name!r} in [signals]: the rig has no such sling, only {', '.join(slings)}")
        signals[name] = read_signal(path, name, entry)
        if joint in motors and signals[name].gain == FREE:
            raise InputError(
                f"{path}: [signals] {name} gain = {FREE!r}; a constant is identified at a joint: mix the motors' "
                "columns there, as in columns = { c5 = 45.0, c6 = 32.0 }"
            )
    return signals


def _values(path: Path, table: Any) -> dict[str, float]:
    if not isinstance(table, dict):
        raise InputError(f'{path}: [parameters] must be a table of "effect.place.parameter" = number')
    for name, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise InputError(f"{path}: [parameters] {name} = {value!r}; allowed is a finite number")
    return {k: float(v) for k, v in table.items()}
