"""Units, through pint."""

from pathlib import Path

import numpy as np
import pint

from ..errors import InputError

#: The package's one unit registry. ``Nm`` is the newton metre here: pint's own ``Nm`` is a textile unit.
UNITS: pint.UnitRegistry = pint.UnitRegistry(on_redefinition="ignore")
UNITS.define("newton_meter = newton * meter = Nm")

_DIMENSIONLESS = {"-": "", "–": "", "1": ""}


def parse_unit(text: str, column: str, path: Path) -> pint.Unit:
    """The unit that ``text`` writes; InputError naming the column when pint does not know it."""
    try:
        return UNITS.Unit(_DIMENSIONLESS.get(text, text))
    except Exception as error:  # pint raises half a dozen kinds, AssertionError among them
        raise InputError(
            f"{path}: column {column!r}: unit {text!r} is unknown to pint; write for example rad, deg/s, N*m or degC"
        ) from error


def fits(unit: pint.Unit, wanted: str) -> bool:
    """True when ``unit`` has the dimension of ``wanted``; an angle has none (pint's convention)."""
    return unit.dimensionality == UNITS.Unit(wanted).dimensionality


def convert(values: np.ndarray, unit: pint.Unit, wanted: str) -> np.ndarray:
    """``values`` in ``unit``, expressed in ``wanted``; temperatures with their offset."""
    target = UNITS.Unit(wanted)
    return values if unit == target else np.asarray(UNITS.Quantity(values, unit).to(target).magnitude)
