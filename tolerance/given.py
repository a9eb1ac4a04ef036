"""Values of a study file, each checked as it is taken: InputError with the place, the value and what is allowed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, unknown_key


def known(path: Path, table: str, given: Mapping[str, Any], allowed: Any) -> None:
    """Refuse keys that are not allowed (InputError), with the nearest that is."""
    for key in given:
        if key not in allowed:
            raise unknown_key(path, key, allowed, table)


def table(path: Path, raw: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """A table of the file, empty where it is not there."""
    table = raw.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: {key} = {table!r}; allowed is a table [{key}]")
    return table


def text(path: Path, raw: Mapping[str, Any], key: str, default: str) -> str:
    """A text in quotes."""
    value = raw.get(key, default)
    if not isinstance(value, str):
        raise InputError(f"{path}: {key} = {value!r}; allowed is text in quotes")
    return value


def number(path: Path, what: str, value: Any) -> float:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{path}: {what} = {value!r}; allowed is a finite number")
    return float(value)


def positive(path: Path, what: str, value: Any) -> float:
    """A number above zero."""
    if not number(path, what, value) > 0:
        raise InputError(f"{path}: {what} = {value!r}; no case can meet it; give a number above zero")
    return float(value)


def count(path: Path, value: Any, what: str, least: int) -> int:
    """A whole number from ``least`` on."""
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InputError(f"{path}: {what} = {value!r}; allowed is a whole number from {least}")
    return value


def flag(path: Path, value: Any, what: str, other: str = "") -> bool:
    """True or false; ``other`` is what else would do, for the message."""
    if not isinstance(value, bool):
        raise InputError(f"{path}: {what} = {value!r}; allowed is true or false{other}")
    return value
