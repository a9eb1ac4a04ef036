"""Units, through pint, which loads where one is written."""

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    import pint

_NONE = ("-", "–", "1")
_WRITTEN = {r"(?<=/)s2\b": "s**2", r"\bN-(?=m)": "N*", r"\bNmm\b": "N*mm", r"\brev\b": "turn", r"^Celsius$": "degC"}
"""What others write, and how pint reads it."""


_POWER = re.compile(r"(?:\*\*|\^)\s*[-+]?\d{1,2}(?:\.\d{1,6})?(?![\d.])(?!\s*(?:\*\*|\^))")
_FACTOR = re.compile(r"\s*-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


@cache
def registry() -> "pint.UnitRegistry":
    """The package's one unit registry. ``Nm`` is the newton metre here: pint's own ``Nm`` is a textile unit."""
    import pint  # here only: where no unit is written, nothing needs it

    units = pint.UnitRegistry(on_redefinition="ignore")
    units.define("newton_meter = newton * meter = Nm")
    return units


def check_unit(text: str) -> None:
    """Raise ValueError for a unit on which pint could take forever.

    pint computes with the numbers in a unit, whatever their powers: ``9**9**9**9`` has 10^369693100 digits. Allowed are
    a factor in front, exponents of two digits on units, and ``1/``.
    """
    factor = _FACTOR.match(text)
    rest = text[factor.end() :] if factor else text
    bare = _POWER.sub(" ", rest)
    raised = (factor and rest.lstrip().startswith(("**", "^"))) or re.search(r"\d\s*[⁰¹²³⁴-⁹]", text)
    numbers = set(re.findall(r"(?<![\w.])[\d.]+", bare)) - {"1"}
    if len(text) > 100 or raised or numbers or "**" in bare or "^" in bare:
        raise ValueError(f"unit {text!r} has numbers that a unit has no use for")


def parse_unit(text: str, column: str, path: Path) -> "pint.Unit":
    """The unit that ``text`` writes; InputError naming the column when pint does not know it."""
    try:
        check_unit(text)
        for pattern, spelled in _WRITTEN.items() if re.fullmatch(r"[\w/*^.-]+", text) else ():
            text = re.sub(pattern, spelled, text)
        return registry().Unit("" if text in _NONE else text)
    except Exception as error:  # pint raises half a dozen kinds, AssertionError among them
        raise InputError(
            f"{path}: column {column!r}: unit {text!r} is unknown to pint; write for example rad, deg/s, N*m or degC"
        ) from error


def fits(unit: "pint.Unit", wanted: str) -> bool:
    """True when ``unit`` has the dimension of ``wanted``; an angle has none (pint's convention)."""
    return unit.dimensionality == registry().Unit(wanted).dimensionality


def convert(values: np.ndarray, unit: "pint.Unit", wanted: str) -> np.ndarray:
    """``values`` in ``unit``, expressed in ``wanted``; temperatures with their offset."""
    target = registry().Unit(wanted)
    return values if unit == target else np.asarray(registry().Quantity(values, unit).to(target).magnitude)
