"""Units at a connection: the factor and offset with which the receiver reads its own unit."""

from typing import Any

from ..errors import InputError
from ..recordings.units import check_unit, registry

_PLAIN = {"": "1", "-": "1", "–": "1"}


def conversion(source: str, target: str) -> tuple[float, float]:
    """Factor and offset that turn a number in ``source`` into one in ``target``: target = factor·source + offset.

    A unit that is not stated (empty) fits every other as it stands. An angle has no dimension, but hertz and radians a
    second are not the same. Raises InputError where the dimensions differ or pint does not know a unit.
    """
    if not source or not target or source == target:
        return 1.0, 0.0
    given, wanted = quantity(source), quantity(target)
    if given.dimensionality != wanted.dimensionality or any(
        _cycles_as_angle(*pair) for pair in ((given, wanted), (wanted, given))
    ):
        raise InputError(f"a value in {source} cannot be read in {target}")
    if given.magnitude == wanted.magnitude == 1:  # also degrees Celsius, which have a zero of their own
        zero, one = (registry().Quantity(value, given.units).to(wanted.units).magnitude for value in (0.0, 1.0))
        return float(one - zero), float(zero)
    return float((given / wanted).to("dimensionless").magnitude), 0.0


def quantity(unit: str) -> Any:
    """A unit, or a number times units (``1000 kg*m``), as pint's quantity; InputError where pint does not know it."""
    text = _PLAIN.get(unit, unit)
    try:
        check_unit(text)
        units = registry()
        return units.Quantity(text) if text[0].isdigit() else units.Quantity(1, units.Unit(text))
    except Exception as error:  # pint raises half a dozen kinds
        raise InputError(f"unit {unit!r} is unknown to pint; write for example rad, deg/s, N*m or degC") from error


def _cycles_as_angle(one: Any, other: Any) -> bool:
    """Hertz on one side and an angle's rate on the other: pint would take them for the same, 2 pi apart."""
    return "hertz" in dict(one.unit_items()) and "radian" in dict(other.to_root_units().unit_items())
