"""Units as FMI wants them: a name, and exponents of SI's base units with a factor and an offset."""

import re
from dataclasses import dataclass

from ..recordings.units import registry

_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
#: Display unit by unit: name, and how many of it one SI unit is.
DISPLAY = {
    "rad": ("deg", 57.29577951308232),
    "rad/s": ("deg/s", 57.29577951308232),
    "rad/s^2": ("deg/s2", 57.29577951308232),
}


@dataclass(frozen=True)
class FmiUnit:
    """A unit's name in FMI's habit (``N.m.s/rad``), exponents of base units, and ``SI = factor * value + offset``."""

    name: str
    exponents: dict[str, int]
    factor: float = 1.0
    offset: float = 0.0


def fmi_name(unit: str) -> str:
    """pint's spelling in FMI's habit: ``N*m*s^2/rad`` is ``N.m.s2/rad``."""
    return re.sub(r"\^|\*\*", "", unit.replace("**", "^").replace("*", "."))


def fmi_unit(unit: str) -> FmiUnit:
    """Definition of a unit in pint's spelling."""
    units = registry()
    if unit == "degC":
        return FmiUnit("degC", {"K": 1}, 1.0, 273.15)
    base = units.Quantity(1.0, units.parse_units(unit)).to_base_units()
    exponents = {_BASE[str(name)]: round(float(str(power))) for name, power in base.unit_items()}
    return FmiUnit(fmi_name(unit), exponents, float(base.magnitude))
