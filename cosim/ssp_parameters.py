"""Parameter sets and mappings of SSP 1.0: which value each component's variable is to have."""

import math
import posixpath
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import unquote
from xml.etree import ElementTree

from ..errors import InputError

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSM = "http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
_NAMES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
    "ssv": SSV,
    "ssm": SSM,
}


@dataclass(frozen=True)
class Values:
    """One value.

    Parameters
    ----------
    name : str
        From the outermost system: ``inner.arm.mass``.
    value : float
    unit : str
        As the file says; empty where it does not, or conversion is suppressed.
    level : int
        How deep the element is that it is bound to.
    factor, offset : float
        Applied after the conversion to the variable's unit.
    """

    name: str
    value: float
    unit: str
    level: int
    factor: float
    offset: float


Read = Callable[[str], ElementTree.Element]
"""Gives the root of a file of the archive, by its name there."""


def bound_parameters(read: Read, element: ElementTree.Element, path: str) -> list[Values]:
    """All values bound to a component or system at ``path`` ("" is the outermost system)."""
    found: list[Values] = []
    for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", _NAMES):
        values = _content(read, binding, binding.find("ssd:ParameterValues/ssv:ParameterSet", _NAMES))
        mapping = binding.find("ssd:ParameterMapping", _NAMES)
        inside = None if mapping is None else mapping.find("ssm:ParameterMapping", _NAMES)
        targets = {} if mapping is None else _targets(_content(read, mapping, inside))
        prefix = binding.get("prefix", "")
        for parameter in values.iterfind("ssv:Parameters/ssv:Parameter", _NAMES):
            value, unit = _value(parameter)
            if value is None:
                continue
            source = f"{prefix}{parameter.get('name', '')}"
            level = path.count(".") + 1 if path else 0
            for target, factor, offset, plain in targets.get(source, [] if targets else [(source, 1.0, 0.0, False)]):
                name = f"{path}.{target}" if path else target
                found.append(Values(name, value, "" if plain else unit, level, factor, offset))
    return found


def _content(read: Read, holder: ElementTree.Element, inside: ElementTree.Element | None) -> ElementTree.Element:
    """What a binding or mapping holds itself, or the file that it names."""
    if inside is not None:
        return inside
    if holder.get("source") is None:
        raise InputError("a parameter binding has neither values nor a source; give one")
    return read(posixpath.normpath(unquote(holder.get("source", ""))))


def _targets(mapping: ElementTree.Element) -> dict[str, list[tuple[str, float, float, bool]]]:
    """For each parameter of the set the variables that it goes to, with factor, offset, and no conversion of units."""
    targets: dict[str, list[tuple[str, float, float, bool]]] = {}
    for entry in mapping.iterfind("ssm:MappingEntry", _NAMES):
        factor, offset = transformation(entry, f"mapping of {entry.get('source')!r}")
        plain = entry.get("suppressUnitConversion") in ("true", "1")
        targets.setdefault(entry.get("source", ""), []).append((entry.get("target", ""), factor, offset, plain))
    return targets


def transformation(element: ElementTree.Element, what: str) -> tuple[float, float]:
    """Factor and offset of a connection or mapping; InputError for a transformation that is not linear."""
    factor, offset = 1.0, 0.0
    for child in element.iterfind("ssc:*", _NAMES):
        if not child.tag.endswith("}LinearTransformation"):
            raise InputError(f"{what}: only linear transformations can be read")
        factor, offset = number(child, "factor", 1.0, what), number(child, "offset", 0.0, what)
    return factor, offset


def number(element: ElementTree.Element, key: str, default: float, what: str) -> float:
    """A finite number among an element's attributes."""
    text = element.get(key)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{what}: {key} = {text!r} is no finite number")
    return value


def _value(parameter: ElementTree.Element) -> tuple[float | None, str]:
    """Number and unit; None for text and bytes, which no participant takes."""
    name = parameter.get("name", "")
    for kind in ("Real", "Integer", "Boolean", "Enumeration"):
        element = parameter.find(f"ssv:{kind}", _NAMES)
        if element is not None:
            text = element.get("value", "")
            if kind == "Boolean":
                return float(text in ("true", "1")), ""
            return number(element, "value", math.nan, f"parameter {name!r}"), element.get("unit", "")
    return None, ""
