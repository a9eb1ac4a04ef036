"""Numbers, units and names as a test engineer reads them; plain text, nothing escaped."""

import math
import re

_SUPERSCRIPT = str.maketrans("-0123456789.", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹·")
_WRITTEN = {"1": "", "N*m*s^2/rad": "kg·m²", "N*s^2/m": "kg"}
"""Products that have a shorter form: torque over acceleration is an inertia, force over acceleration a mass."""
_MISSING = "–"
_PEOPLE = re.compile(r"\b(coulomb|stribeck|makkar)\b")


def words(name: str) -> str:
    """A vocabulary name in words: ``coulomb_friction`` is "Coulomb friction"."""
    return _PEOPLE.sub(lambda match: match[0].capitalize(), name.replace("_", " "))


def unit_words(unit: str) -> str:
    """A unit as engineers write it: ``N*m/rad**2`` is "N·m/rad²", ``N*m*s^2/rad`` "kg·m²", ``1`` is nothing."""
    plain = re.sub(r"\s+", "", unit).replace("**", "^")
    raised = re.sub(r"\^(-?\d+(?:\.\d+)?)", lambda match: match[1].translate(_SUPERSCRIPT), plain)
    return _WRITTEN.get(plain, raised.replace("*", "·"))


def number(value: float, digits: int = 3) -> str:
    """A number to so many significant digits; far from one with a power of ten."""
    if not math.isfinite(value):
        return _MISSING
    if value == 0:
        return "0"
    exponent = _exponent(value, digits)
    if -4 <= exponent <= 5:
        return _fixed(value, digits - 1 - exponent)
    return f"{_fixed(value / 10.0**exponent, digits - 1)}\u2009×\u200910{str(exponent).translate(_SUPERSCRIPT)}"


def percent(share: float, digits: int = 2) -> str:
    """A share (0 to 1) as a percentage to so many significant digits, at most ``max(2, digits - 1)`` decimals.

    Prose takes two digits, a table three.
    """
    if not math.isfinite(share):
        return _MISSING
    value = 100 * share
    if value == 0:
        return "0 %"
    if abs(value) < 0.005:
        return "under 0.01 %"
    return f"{_fixed(value, max(0, min(digits - 1 - _exponent(value, digits), max(2, digits - 1))))} %"


def chance(probability: float) -> str:
    """A probability as a whole percentage; never "100 %", which nothing measured can be, nor "0 %"."""
    if not math.isfinite(probability):
        return _MISSING
    if probability > 0.99:
        return "over 99 %"
    if probability < 0.01:
        return "under 1 %"
    return f"{100 * probability:.0f} %"


def with_std(value: float, std: float) -> tuple[str, str]:
    """A value and its standard deviation to the same last digit: one of the deviation's, two where it begins with 1."""
    if not (math.isfinite(value) and math.isfinite(std) and std > 0):
        return number(value, 4), _MISSING
    last = _exponent(std, 7) - (f"{std:e}"[0] == "1")
    size = _exponent(max(abs(value), std), 3)
    if -4 <= size <= 5:
        return _fixed(value, -last), _fixed(std, -last)
    power = f"\u2009×\u200910{str(size).translate(_SUPERSCRIPT)}"
    return _fixed(value / 10.0**size, size - last) + power, _fixed(std / 10.0**size, size - last) + power


def measured(value: float, std: float, unit: str = "") -> str:
    """A value with its standard deviation and unit: ``20.39 ± 0.05 N``, ``(9.9 ± 0.2) × 10⁻⁵ rad``."""
    shown, spread = with_std(value, std)
    (number_, times, power), (deviation, _, same) = shown.partition("\u2009×"), spread.partition("\u2009×")
    if times and power == same:
        shown, spread = f"({number_}", f"{deviation}){times}{power}"
    return f"{shown} ± {spread} {unit_words(unit)}".rstrip()


def spans(windows: tuple[tuple[float, float], ...], most: int = 8) -> str:
    """Time windows in seconds, the first few of many."""
    text = ", ".join(f"{start:.1f}–{end:.1f}" for start, end in windows[:most])
    if not windows:
        return _MISSING
    return f"{text} s" + (f", and {len(windows) - most} more" if len(windows) > most else "")


def _exponent(value: float, digits: int) -> int:
    """Power of ten of the leading digit, once rounded to so many digits."""
    return int(f"{abs(value):.{digits - 1}e}".split("e")[1])


def _fixed(value: float, decimals: int) -> str:
    rounded = round(value, decimals)
    return f"{rounded + 0.0:.{max(decimals, 0)}f}".replace("-", "\u2212")
