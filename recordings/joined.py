"""Recordings in several files: signals whose column is in another file of the folder, row by row."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from .columns import Columns, split_header
from .signals import Signal


def with_files(
    columns: Columns, signals: Mapping[str, Signal], load: Callable[[Path], Columns]
) -> tuple[Columns, dict[str, Signal]]:
    """Columns with those of other files beside them, as ``file/header``, and the signals, each of one table.

    Parameters
    ----------
    columns : Columns
        Of the recording's own file.
    signals : mapping of str to Signal
    load : callable
        Reads another file.

    Raises
    ------
    InputError
        The other file is missing or has another number of rows, or has not the column.
    """
    others: dict[str, Columns] = {}
    arrays, plain, rows = dict(columns.arrays), dict(signals), _rows(columns)
    for name, signal in signals.items():
        if signal.file is None:
            continue
        path = columns.path.parent / signal.file
        if signal.file not in others:
            others[signal.file] = other = load(path)
            if _rows(other) != rows:
                raise InputError(
                    f"{path}: has {_rows(other)} rows and {columns.path.name} {rows}; [signals] {name!r} takes a row "
                    "of each for one sample: they must have as many"
                )
        other, weights = others[signal.file], {}
        for column, weight in signal.parts.items():
            header = other.numbered(column, name)
            there, values = _named(signal.file, header, *other.column(header, name))
            arrays[there], weights[there] = values, weight
        first = next(iter(weights))
        single = not signal.columns
        plain[name] = replace(signal, file=None, column=first if single else "", columns={} if single else weights)
    return replace(columns, arrays=arrays), plain


def _named(file: str, asked: str, header: str, values: np.ndarray) -> tuple[str, np.ndarray]:
    """What a column of another file is called here: ``file/name [unit]``; one of a table's, ``file/name.0 [unit]``."""
    bare, unit = split_header(header)
    index = re.search(r"\[(\d+)\]$", asked) if asked not in (header, bare) else None
    return f"{file}/{bare}" + (f".{index[1]}" if index else "") + ("" if unit is None else f" [{unit}]"), values


def _rows(columns: Columns) -> int:
    return max((max(array.shape) for array in columns.arrays.values()), default=0)
