"""An FMU's variables as a participant's: names, causality, units in pint's spelling, direct feedthrough."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product
from typing import Any

from ..errors import InputError
from .participant import Causality, Variable
from .units import quantity

_NUMBERS = ("Real", "Float32", "Float64", "Integer", "Enumeration", "Boolean")
_WHOLE = re.compile(r"U?Int\d+")
_MOST, _MOST_DEPENDENCIES = 100_000, 5_000_000
_BASE = {"kg": "kg", "m": "m", "s": "s", "A": "A", "K": "K", "mol": "mol", "cd": "cd", "rad": "rad"}


@dataclass(frozen=True)
class FmiVariable:
    """One variable of the model description, scalar or array, and the participant's scalars that it stands for."""

    reference: int
    type: str
    names: tuple[str, ...]
    continuous: bool


@dataclass(frozen=True)
class Interface:
    """All scalars in the order of the model description, and the position of each in the FMU.

    ``unread`` are the inputs that hold no number, by name, with their type: nothing can be connected to them, and they
    keep the start values that the FMU gives them.
    """

    variables: tuple[Variable, ...]
    slots: Mapping[Causality, tuple[FmiVariable, ...]]
    unread: Mapping[str, str]


def read_interface(description: Any, path: object) -> Interface:
    """Inputs, outputs and parameters that are numbers.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription
    path : object
        The FMU, for messages.

    Raises
    ------
    InputError
        For numbers and dimensions that are none, and for more elements of arrays than can be read.
    """
    try:
        return _read(description, path)
    except InputError as error:
        raise InputError(text if (text := str(error)).startswith(str(path)) else f"{path}: {text}") from None


def _read(description: Any, path: object) -> Interface:
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    sizes = {v.valueReference: v for v in description.modelVariables}
    groups: dict[Causality, list[FmiVariable]] = {"input": [], "output": [], "parameter": []}
    variables: list[Variable] = []
    shown = [v for v in description.modelVariables if v.causality in groups]
    numbers = [v for v in shown if _is_number(v)]
    unread = {v.name: v.type for v in shown if v.causality == "input" and not _is_number(v)}
    _check_count(numbers, sizes)
    names_of = {v.name: _names(v, sizes) for v in numbers}
    depends = _dependencies(description, names_of)
    for v in numbers:
        names = names_of[v.name]
        groups[v.causality].append(FmiVariable(v.valueReference, v.type, names, v.variability in (None, "continuous")))
        unit = v.unit or (v.declaredType.unit if v.declaredType else None) or ""
        starts = _numbers(v.start, len(names))
        spelled, low, high = pint_unit(unit, units.get(unit)), _number(v.min, -math.inf), _number(v.max, math.inf)
        on = depends.get(v.name) if v.causality == "output" else ()
        variables += [
            Variable(name, v.causality, spelled, start, v.description or "", low, high, on)
            for name, start in zip(names, starts, strict=True)
        ]
    return Interface(tuple(variables), {causality: tuple(slots) for causality, slots in groups.items()}, unread)


def _is_number(v: Any) -> bool:
    return v.type in _NUMBERS or _WHOLE.fullmatch(v.type) is not None


def pint_unit(name: str, base: Any = None) -> str:
    """The unit in pint's spelling.

    FMI's names are free text (``N.m``, ``m/s2``); what counts are the exponents of its base unit, where they are given.
    A name that pint reads as the same is kept, else the base unit is written out. A name that neither explains stays.
    """
    spelled = re.sub(r"([A-Za-z])(-?\d+)", r"\1**\2", name.replace("·", "*").replace(".", "*").replace(" ", "*"))
    try:
        read = quantity(spelled) if spelled else None
    except InputError:
        read = None
    if base is None:
        return spelled if read is not None else name
    powers = "*".join(f"{unit}**{getattr(base, key)}" for key, unit in _BASE.items() if getattr(base, key)) or "1"
    meant = quantity(powers if base.factor == 1 else f"{base.factor!r} * {powers}")
    if read is not None and read.dimensionality == meant.dimensionality and _zero(read) == base.offset:
        ratio = 1.0 if base.offset else float((read / meant).to("dimensionless").magnitude)
        if math.isclose(ratio, 1.0, rel_tol=1e-6):
            return spelled
    return name if base.offset else powers if base.factor == 1 else f"{base.factor!r} * {powers}"


def _zero(read: Any) -> float:
    """What the unit's zero is in its root unit: 273.15 for degrees Celsius."""
    return round(float(type(read)(0.0, read.units).to_root_units().magnitude), 9)


def _lengths(v: Any, sizes: Mapping[int, Any]) -> list[int]:
    """Lengths of an array's dimensions, none of a scalar's; as many elements as can be read at most."""
    try:
        lengths = [int(d.start if d.start is not None else sizes[d.valueReference].start) for d in v.dimensions]
    except (TypeError, ValueError, KeyError):
        raise InputError(f"variable {v.name!r} has a dimension that is no whole number; correct it") from None
    if lengths and (min(lengths) < 1 or math.prod(lengths) > _MOST):
        raise InputError(f"variable {v.name!r} has dimensions {lengths}; 1 to {_MOST} elements can be read")
    return lengths


def _check_count(variables: Sequence[Any], sizes: Mapping[int, Any]) -> None:
    """Refuse arrays that have more elements together than can be read; a scalar has its place in the description."""
    elements = 0
    for v in variables:
        lengths = _lengths(v, sizes)
        elements += math.prod(lengths) if lengths else 0
        if elements > _MOST:
            raise InputError(f"arrays down to {v.name!r} have {elements} elements together; {_MOST} can be read")


def _names(v: Any, sizes: Mapping[int, Any]) -> tuple[str, ...]:
    """A scalar's name, or one name an element, counted from 1 in the order of the values."""
    lengths = _lengths(v, sizes)
    if not lengths:
        return (v.name,)
    return tuple(f"{v.name}[{','.join(map(str, at))}]" for at in product(*(range(1, n + 1) for n in lengths)))


def _dependencies(description: Any, names_of: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...] | None]:
    """Inputs that each output depends on; None where the model description does not say."""
    found: dict[str, tuple[str, ...] | None] = {}
    count = 0
    for unknown in description.outputs:
        if unknown.dependencies is None:
            found[unknown.variable.name] = None
        else:
            known = [names_of.get(v.name, ()) for v in unknown.dependencies if v.causality == "input"]
            count += sum(map(len, known))
            if count > _MOST_DEPENDENCIES:
                raise InputError(f"outputs depend on inputs {count} times; {_MOST_DEPENDENCIES} can be read")
            found[unknown.variable.name] = tuple(chain.from_iterable(known))
    return found


def _numbers(text: Any, count: int) -> list[float]:
    values = (str(text).split() if text is not None else []) or ["0"]
    return [_number(value, 0.0) for value in (values if len(values) == count else values[:1] * count)]


def _number(text: Any, default: float) -> float:
    if text is None:
        return default
    if str(text) in ("true", "false"):
        return float(str(text) == "true")
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{text!r} is no number; correct the model description") from None
