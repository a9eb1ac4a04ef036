"""A control program as a table of states, read from TOML: each state's commands and transitions."""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from operator import eq, ge, gt, le, lt
from pathlib import Path
from typing import Any

from ..errors import InputError, nearest

SENSORS = (
    "ring", "ring_torque", "travel", "rate", "moved", "gap", "force", "drop", "wrist", "switches", "closed",
    "enclosed", "touching",
)  # fmt: skip
"""What conditions read, in the units that `programs/end_effector.toml` tells."""
NUMBERS, SWITCHES = ("ring", "carriage", "force", "gain", "most"), ("motor", "brake", "latch", "servo")
DEFAULT = Path(__file__).parent / "programs" / "end_effector.toml"
_CONDITION = re.compile(r"\s*([a-z_]+)\s*(<=|>=|<|>|=)\s*([-+0-9.eE]+)\s*")
_COMPARE = {"<": lt, ">": gt, "<=": le, ">=": ge, "=": eq}


@dataclass(frozen=True)
class Condition:
    """A comparison of a sensor with a number."""

    sensor: str
    relation: str
    value: float

    def holds(self, sensors: Mapping[str, float]) -> bool:
        """Whether the condition holds."""
        return _COMPARE[self.relation](sensors[self.sensor], self.value)


@dataclass(frozen=True)
class Transition:
    """The next state when all conditions have held for ``during`` [s]; taken ``at_most`` this often."""

    when: tuple[Condition, ...]
    to: str
    during: float = 0.0
    at_most: float = inf


@dataclass(frozen=True)
class State:
    """Commands by name, transitions in order, and the timeout: after how long [s], and where to."""

    name: str
    commands: Mapping[str, float]
    leave: tuple[Transition, ...] = ()
    after: float = inf
    timeout: str = ""


@dataclass(frozen=True)
class StateTable:
    """States by name, in the file's order; period of the program [s]; the first state."""

    states: Mapping[str, State]
    period: float
    start: str
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Number the states."""
        object.__setattr__(self, "names", tuple(self.states))


def read_table(path: str | Path = DEFAULT) -> StateTable:
    """Read a table; raises InputError with place, value and mend."""
    path = Path(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: {error}") from None
    return table_of(content, str(path))


def table_of(content: Mapping[str, Any], owner: str = "program") -> StateTable:
    """A table from what its TOML says."""
    _known(content, ("period", "start", "states"), owner)
    states = content.get("states")
    if not isinstance(states, dict) or not states:
        raise InputError(f"{owner}: there are no states; add a table [states.NAME]")
    period = _number(content.get("period", 0.01), f"{owner}: period", 1e-6)
    start = content.get("start", next(iter(states)))
    table = {name: _state(name, given, states, f"{owner}: state {name}") for name, given in states.items()}
    _target(start, states, f"{owner}: start")
    return StateTable(table, period, start)


def _state(name: str, given: Any, states: Mapping[str, Any], owner: str) -> State:
    if not isinstance(given, dict):
        raise InputError(f"{owner}: is {given!r}; give a table")
    _known(given, (*NUMBERS, *SWITCHES, "leave", "timeout"), owner)
    commands = {key: _number(given[key], f"{owner}: {key}") for key in NUMBERS if key in given}
    for key in SWITCHES:
        if not isinstance(given.get(key, False), bool):
            raise InputError(f"{owner}: {key} is {given[key]!r}; give true or false")
        commands[key] = float(given.get(key, False))
    if "force" in given and "carriage" in given:
        raise InputError(f"{owner}: has both carriage and force; keep one")
    if "force" in given and not {"gain", "most"} <= given.keys():
        raise InputError(f"{owner}: force needs gain [mm/s per N] and most [mm/s]; give both")
    leave = given.get("leave", [])
    if not isinstance(leave, list):
        raise InputError(f"{owner}: leave is {leave!r}; give a list of tables")
    transitions = tuple(_transition(one, states, f"{owner}: leave[{k}]") for k, one in enumerate(leave))
    timeout = given.get("timeout", {})
    if not isinstance(timeout, dict):
        raise InputError(f"{owner}: timeout is {timeout!r}; give {{ after = seconds, to = state }}")
    if not timeout:
        return State(name, commands, transitions)
    _known(timeout, ("after", "to"), f"{owner}: timeout")
    after = _number(timeout.get("after"), f"{owner}: timeout.after", 0.0)
    return State(name, commands, transitions, after, _target(timeout.get("to"), states, f"{owner}: timeout"))


def _transition(given: Any, states: Mapping[str, Any], owner: str) -> Transition:
    if not isinstance(given, dict):
        raise InputError(f"{owner}: is {given!r}; give a table with when and to")
    _known(given, ("when", "to", "during", "at_most"), owner)
    when = given.get("when")
    if not isinstance(when, list) or not when:
        raise InputError(f"{owner}: when is {when!r}; give a list of conditions as 'force > 50'")
    conditions = []
    for text in when:
        found = _CONDITION.fullmatch(text) if isinstance(text, str) else None
        if found is None:
            raise InputError(f"{owner}: condition {text!r}; write a sensor, one of < > <= >= =, and a number")
        if found[1] not in SENSORS:
            raise InputError(f"{owner}: no sensor {found[1]!r}; nearest is {nearest(found[1], SENSORS)!r}")
        conditions.append(Condition(found[1], found[2], _number(_float(found[3]), f"{owner}: condition {text!r}")))
    return Transition(
        tuple(conditions),
        _target(given.get("to"), states, owner),
        _number(given.get("during", 0.0), f"{owner}: during", 0.0),
        _number(given["at_most"], f"{owner}: at_most", 1.0) if "at_most" in given else inf,
    )


def _float(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def _number(value: Any, owner: str, lowest: float = -inf) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < inf or value < lowest:
        bound = "" if lowest == -inf else f" from {lowest:g} up"
        raise InputError(f"{owner} is {value!r}; give a number{bound}")
    return float(value)


def _target(name: Any, states: Mapping[str, Any], owner: str) -> str:
    if not isinstance(name, str) or name not in states:
        raise InputError(f"{owner}: no state {name!r}; nearest is {nearest(str(name), states)!r}")
    return name


def _known(given: Mapping[str, Any], allowed: tuple[str, ...], owner: str) -> None:
    for key in given:
        if key not in allowed:
            raise InputError(f"{owner}: no key {key!r}; nearest is {nearest(key, allowed)!r}")
