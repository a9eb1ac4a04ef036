"""Systems written by hand, in TOML.

An input names the output that it reads, so that no input can be connected twice::

    step = 1e-3
    stop = 10.0
    hold = "midpoint"

    [participants.left]
    fmu = "left.fmu"
    parameters = { mass = 2.0 }

    [participants.control]
    python = "my_package.control:Controller"
    options = { gain = 3.0 }

    [connections]
    "left.force" = "control.force"
    "control.x" = { source = "left.x", factor = -1.0 }

    [bonds]
    drive = { effort = "control.force", flow = "left.v" }
"""

import importlib
import sys
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..errors import InputError, nearest
from ..files import toml_table
from .experiment import Setup
from .hosting import Hosting
from .iteration import Iteration
from .participant import Participant
from .step_control import StepControl
from .system import Connection, PowerBond, System

_RUN = {field.name: type(field.default) for field in fields(Setup) if isinstance(field.default, float | str)}
_KEYS = (*_RUN, "name", "iterate", "control", "participants", "connections", "bonds")
_PARTICIPANT = ("fmu", "python", "options", "parameters", "own_process", "timeout")


def read_toml(path: Path, hosting: Hosting) -> Setup:
    """Read a system and build its participants; raises InputError with the file's name for a mistake in it."""
    content = toml_table(path)
    built: dict[str, Participant] = {}
    try:
        return _read(content, path, hosting, built)
    except InputError as error:
        for participant in built.values():
            participant.close()
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None


def _read(content: Mapping[str, Any], path: Path, hosting: Hosting, built: dict[str, Participant]) -> Setup:
    _known(content, _KEYS, "file")
    run: dict[str, Any] = {key: _typed(content[key], kind, key) for key, kind in _RUN.items() if key in content}
    iterate = content.get("iterate", False)
    run["iterate"] = Iteration(**_options(iterate, Iteration, "iterate")) if isinstance(iterate, dict) else iterate
    if "control" in content:
        run["control"] = StepControl(**_options(content["control"], StepControl, "control"))
    entries = _table(content, "participants")
    if not entries:
        raise InputError("has no [participants]; add [participants.NAME] with fmu = or python =")
    connections = [_connection(target, source) for target, source in _table(content, "connections").items()]
    bonds = [PowerBond(name, **_options(b, PowerBond, f"bonds.{name}")) for name, b in _table(content, "bonds").items()]
    parameters: dict[str, float] = {}
    for name, entry in entries.items():
        place = f"participants.{name}"
        _known(_typed(entry, dict, place), _PARTICIPANT, place)
        given = _typed(entry.get("parameters", {}), dict, f"{place}.parameters")
        parameters |= {f"{name}.{key}": _typed(value, float, f"{place}.{key}") for key, value in given.items()}
        built[name] = _participant(name, entry, path, hosting)
    system = System(built, connections, parameters=parameters, bonds=bonds, name=content.get("name", path.stem))
    return Setup(system, **run)


def _participant(name: str, entry: Mapping[str, Any], path: Path, hosting: Hosting) -> Participant:
    place = f"participants.{name}"
    if ("fmu" in entry) == ("python" in entry):
        raise InputError(f"{place}: give either fmu = a file or python = 'module:Class'")
    place_of = Hosting(
        _typed(entry.get("own_process", hosting.own_process), bool, f"{place}.own_process"),
        _typed(entry.get("timeout", hosting.timeout), float, f"{place}.timeout"),
    )
    if "fmu" in entry:
        from .participants.fmu import Fmu  # loads FMPy, which only FMUs need

        return place_of.build(Fmu, path.parent / _typed(entry["fmu"], str, f"{place}.fmu"), name)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))  # a class beside the system file is found
    make = _imported(_typed(entry["python"], str, f"{place}.python"), place)
    try:
        return place_of.build(make, **_typed(entry.get("options", {}), dict, f"{place}.options"))
    except TypeError as error:
        raise InputError(f"{place}.options: {error}") from None


def _imported(text: str, place: str) -> Any:
    module, _, name = text.partition(":")
    try:
        found = getattr(importlib.import_module(module), name)
    except Exception as error:  # the module is the user's own and may raise anything
        raise InputError(f"{place}: python = {text!r} cannot be imported ({error}); write 'module:Class'") from None
    if not (isinstance(found, type) and issubclass(found, Participant)):
        raise InputError(
            f"{place}: {text!r} is no participant; it must derive from snarelab.cosim.participant.Participant"
        )
    return found


def _connection(target: str, source: Any) -> Connection:
    if isinstance(source, str):
        return Connection(source, target)
    return Connection(target=target, **_options(source, Connection, f"connections.'{target}'"))


def _options(given: Any, kind: type, place: str) -> dict[str, Any]:
    """Fields of a dataclass, as a table gives them."""
    named = [field.name for field in fields(kind) if field.name not in ("name", "target")]
    required = {"source", "effort", "flow"} & set(named)
    _known(_typed(given, dict, place), named, place)
    if missing := required - set(given):
        raise InputError(f"{place}: has no {min(missing)}; add it")
    numbers = {"tolerance", "smallest", "largest", "factor", "offset"}
    whole = {"limit", "kept"}
    types = {
        key: float if key in numbers else int if key in whole else dict if key == "magnitudes" else str for key in given
    }
    return {key: _typed(value, types[key], f"{place}.{key}") for key, value in given.items()}


def _table(content: Mapping[str, Any], key: str) -> dict[str, Any]:
    return _typed(content.get(key, {}), dict, key)


def _known(given: Mapping[str, Any], known: Any, place: str) -> None:
    for key in given:
        if key not in known:
            raise InputError(f"{place}: {key!r} is unknown; nearest is {nearest(key, known)!r}")


def _typed(value: Any, kind: Any, place: str) -> Any:
    """The value, where it is of this kind; a whole number will do for a number."""
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        wanted = {float: "a number", int: "a whole number", str: "text", bool: "true or false", dict: "a table"}[kind]
        raise InputError(f"{place}: {value!r} is not {wanted}")
    return value
