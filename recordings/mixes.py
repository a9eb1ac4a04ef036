"""Signals that are no single column of a recording: mixes, shifts, columns by number, and time from a rate.

Each is worked out once and put beside the recording's own columns, so that all that follows (units, gains, checks)
sees a column like any other.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest
from .columns import Columns, split_header
from .signals import FREE, Signal


def with_mixes(columns: Columns, signals: Mapping[str, Signal]) -> tuple[Columns, dict[str, Signal]]:
    """Columns with those that signals make of others, and the signals, each now with one column of its own.

    Raises
    ------
    InputError
        A column that is not there, mixed columns of different units or lengths, a number beyond the last column.
    """
    made: dict[str, np.ndarray] = {}
    plain: dict[str, Signal] = {}
    for name, signal in signals.items():
        if signal.nothing:
            continue  # nothing drives the joint: there is no column to read
        if signal.rate is not None:
            header = f"1 / {signal.rate:g} Hz"
            made[header] = np.arange(_length(columns)) / signal.rate
            plain[name] = replace(signal, column=header, rate=None, unit="s")
            continue
        weights = {columns.numbered(c, name): w for c, w in signal.parts.items()}
        if len(weights) == 1 and signal.offset == 0 and set(weights.values()) == {1.0}:
            plain[name] = replace(signal, column=next(iter(weights)), columns={})
            continue
        found = [(weight, *columns.column(column, name)) for column, weight in weights.items()]
        units = {split_header(header)[1] for _, header, _ in found}
        lengths = {len(values) for *_, values in found}
        if len(units) > 1 or len(lengths) > 1:
            what = "units" if len(units) > 1 else "lengths"
            raise InputError(
                f"{columns.path}: [signals] {name!r} mixes columns of different {what} ({', '.join(weights)}); "
                "mix such as are in one unit and of one length"
            )
        header = _formula(weights, signal.offset)
        unit = next(iter(units))
        header += f" [{unit}]" if unit is not None else ""
        made[header] = np.sum([w * values for w, _, values in found], axis=0) + signal.offset
        plain[name] = replace(signal, column=header, columns={}, offset=0.0)
    used = {header for name, s in signals.items() for header in s.parts if name in plain and header not in made}
    kept = replace(columns, arrays={**columns.arrays, **made})
    return (kept if not made else replace(kept, mixed=frozenset(map(str, used)))), plain


def _length(columns: Columns) -> int:
    """Rows of a recording: of its longest column."""
    return max((max(array.shape) for array in columns.arrays.values()), default=0)


def _formula(weights: Mapping[str, float], offset: float) -> str:
    """What a mix is, as people write it: ``45*c5 + 32*c6 - 0.5``; brackets would be read as a unit."""
    text = ""
    for column, weight in weights.items():
        bare = re.sub(r"[\[\]]", "", split_header(column)[0])
        sign = ("-" if weight < 0 else "") if not text else (" - " if weight < 0 else " + ")
        text += sign + (bare if abs(weight) == 1 else f"{abs(weight):g}*{bare}")
    return text if not offset else f"{text} {'-' if offset < 0 else '+'} {abs(offset):g}"


_SIGNAL_KEYS = ("column", "unit", "gain", "columns", "offset", "rate", "file")


def read_signal(path: Path, name: str, entry: object) -> Signal:
    """One entry of a model file's [signals]; raises InputError where it is of no form that there is."""
    if entry == "none":
        if not name.startswith("tau."):
            raise InputError(
                f"{path}: [signals] {name} = 'none'; only a torque can be none, where nothing drives a joint"
            )
        return Signal("", nothing=True)
    fields = {"column": entry} if isinstance(entry, str) else entry
    if not isinstance(fields, dict) or len({"column", "columns", "rate"} & set(fields)) != 1:
        raise InputError(
            f"{path}: [signals] {name} = {entry!r}; allowed is {{ column = ..., unit = ..., gain = ... }}, "
            "{ columns = { name = weight, ... } }, for time { rate = Hz }, and for a torque 'none'"
        )
    for key in set(fields) - set(_SIGNAL_KEYS):
        raise InputError(
            f"{path}: [signals] {name} has {key!r}; allowed are {', '.join(_SIGNAL_KEYS)}; did you mean "
            f"{nearest(key, _SIGNAL_KEYS)!r}?"
        )
    column, columns = fields.get("column", ""), fields.get("columns", {})
    if isinstance(column, bool) or not isinstance(column, str | int):
        raise InputError(f"{path}: [signals] {name} column = {column!r}; allowed is a name, or a number from 1")
    if (
        not isinstance(columns, dict)
        or ("columns" in fields and not columns)
        or not all(map(_number, columns.values()))
    ):
        raise InputError(f"{path}: [signals] {name} columns = {columns!r}; allowed is {{ name = weight, ... }}")
    if not isinstance(fields.get("unit"), str | None):
        raise InputError(f"{path}: [signals] {name} unit = {fields['unit']!r}; allowed is text in quotes")
    gain = fields.get("gain")
    if isinstance(gain, bool) or not isinstance(gain, int | float | str | None):
        raise InputError(f"{path}: [signals] {name} gain = {gain!r}; allowed is a number or a scalar's name")
    if gain == FREE and not name.startswith("tau."):
        raise InputError(f"{path}: [signals] {name} gain = {FREE!r}; only a torque's constant can be identified")
    offset, rate = fields.get("offset", 0.0), fields.get("rate")
    if not _number(offset):
        raise InputError(f"{path}: [signals] {name} offset = {offset!r}; allowed is a number, in the column's unit")
    if rate is not None and not (name == "time" and isinstance(rate, int | float) and _number(rate) and rate > 0):
        raise InputError(f"{path}: [signals] {name} rate = {rate!r}; allowed is, for time, a positive number of hertz")
    file = fields.get("file")
    if file is not None and (not isinstance(file, str) or not file or rate is not None):
        raise InputError(
            f"{path}: [signals] {name} file = {file!r}; allowed is a file's name, from the recording's folder"
        )
    weights = {k: float(w) for k, w in columns.items()}
    frequency = None if rate is None else float(rate)
    return Signal(column, fields.get("unit"), gain, weights, float(offset), frequency, file=file)


def signal_fields(signal: Signal) -> dict[str, object] | str:
    """The entry of a model file that `read_signal` reads back."""
    if signal.nothing:
        return "none"
    fields: dict[str, object] = {"rate": signal.rate} if signal.rate is not None else {}
    if signal.columns:
        fields["columns"] = dict(signal.columns)
    elif not fields:
        fields["column"] = signal.column
    fields |= {"unit": signal.unit, "gain": signal.gain, "offset": signal.offset or None, "file": signal.file}
    return {key: value for key, value in fields.items() if value is not None}


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
