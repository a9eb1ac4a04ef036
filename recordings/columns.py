"""The common form of every file format: names, arrays, single numbers, and what could not be read.

Readers know their file format and nothing of signals or units; the rest of the package knows ``Columns`` and nothing of
file formats.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest

LARGEST = 4 << 30
"""Most bytes of numbers that are read from a recording, and of a file that is read at once."""

MOST_COLUMNS = 10_000
"""Most columns of a recording; some of what is done to one looks at all the others."""

_ELEMENT = re.compile(r"(?P<name>.+)\[(?P<index>\d+)\]")
_HEADER = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]")


def check_size(path: Path, size: int) -> None:
    """Raise InputError, before unpacking, where a recording unpacks to more than `LARGEST` bytes."""
    if size > LARGEST:
        raise InputError(
            f"{path}: unpacks to {size / 2**30:.1f} GiB of numbers and at most {LARGEST >> 30} are read; "
            "it is damaged, or cut it into parts"
        )


def check_count(path: Path, count: int) -> None:
    """Raise InputError where a recording has more than `MOST_COLUMNS` columns."""
    if count > MOST_COLUMNS:
        raise InputError(
            f"{path}: has {count} columns and at most {MOST_COLUMNS} are read; leave out what is no signal"
        )


def split_header(header: str) -> tuple[str, str | None]:
    """Name and unit of a column header: ``"q.joint1 [deg]"`` is ``("q.joint1", "deg")``; no brackets, no unit."""
    match = _HEADER.fullmatch(header.strip())
    return (match["name"], match["unit"].strip()) if match else (header.strip(), None)


@dataclass(frozen=True)
class Columns:
    """The content of one recording's file, without units and signals.

    Parameters
    ----------
    path : Path
        The file, for messages.
    arrays : mapping of str to ndarray
        Numeric columns of shape (n_samples,), or (n_samples, k) and (k, n_samples), addressed as ``"name[0]"``.
    scalars : mapping of str to float
        Single numbers stored beside the columns.
    problems : mapping of str to str
        Columns that are there and cannot be read as numbers, and why; an error only if the column is wanted.
    notes : tuple of str
        What the reader did that a user should know.
    row : callable
        Turns a sample's index into the row number that a person sees in the file.
    order : tuple of str
        Headers in the file's order, where columns can be given by number.
    mixed : frozenset of str
        Columns that others were made of.
    """

    path: Path
    arrays: Mapping[str, np.ndarray]
    scalars: Mapping[str, float] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    row: Callable[[int], int] = lambda index: index + 1
    order: tuple[str, ...] = ()
    mixed: frozenset[str] = frozenset()

    @property
    def names(self) -> list[str]:
        """All names in the file, columns first."""
        return [*self.arrays, *self.problems, *self.scalars]

    def numbered(self, column: str | int, signal: str) -> str:
        """The header of a column, which may be given by its number, from 1; InputError beyond the last."""
        if isinstance(column, str):
            return column
        headers = self.order or self.names
        if not 1 <= column <= len(headers):
            raise InputError(
                f"{self.path}: [signals] {signal!r} is column number {column}; the file has {len(headers)}: 1 to "
                f"{len(headers)}"
            )
        return headers[column - 1]

    def column(self, name: str, signal: str, n_samples: int | None = None) -> tuple[str, np.ndarray]:
        """Header and values of one column, shape (n_samples,), float64.

        ``name`` is the header, the header without its unit, or ``"name[i]"`` for one row or column (counted from zero)
        of a two-dimensional array; its samples run along the axis that has ``n_samples`` entries, or the longer one
        where that is not known yet. Raises InputError when the column is missing, unreadable or not a column.
        """
        header, index = self._locate(name)
        if header is None:
            raise InputError(
                f"{self.path}: column {name!r} of [signals] {signal!r} is not one of its {len(self.names)} columns; "
                f"nearest is {nearest(name, self.names)!r}; correct [signals] in the model file"
            )
        where = f"{self.path}: column {name!r} ({signal})" if name != signal else f"{self.path}: column {name!r}"
        if header in self.problems:
            raise InputError(f"{where}: {self.problems[header]}")
        if header in self.scalars:
            raise InputError(f"{where}: is a single number, not a column; it can serve as a gain")
        values = self.arrays[header]
        if index is not None:
            if values.ndim == 1:
                raise InputError(f"{where}: {header!r} has one column only; write {header!r} without the index")
            along = int(np.argmax(values.shape)) if n_samples is None else int(values.shape[0] != n_samples)
            if index >= values.shape[1 - along]:
                raise InputError(f"{where}: {header!r} has columns 0 to {values.shape[1 - along] - 1}")
            values = np.take(values, index, axis=1 - along)
        elif values.ndim == 2:
            raise InputError(f"{where}: is an array of {values.shape}; choose one column, as in '{header}[0]'")
        if n_samples is not None and len(values) != n_samples:
            raise InputError(f"{where}: has {len(values)} samples and time has {n_samples}; they must be equal")
        return header, values.astype(np.float64)

    def scalar(self, name: str, signal: str) -> float:
        """The single number called ``name``: a scalar, one element ``"name[i]"``, or a column that never changes."""
        if name in self.scalars:
            return self.scalars[name]
        header, index = self._locate(name)
        if header is None or header in self.problems:
            raise InputError(
                f"{self.path}: gain {name!r} of [signals] {signal!r} is not one of its {len(self.names)} names; "
                f"nearest is {nearest(name, [*self.scalars, *self.arrays])!r}; correct [signals] in the model file"
            )
        values = np.ravel(self.arrays[header])
        if index is not None and self.arrays[header].ndim == 1 and index < len(values):
            return float(values[index])
        values = np.unique(values[np.isfinite(values)])
        if index is not None or len(values) != 1:
            raise InputError(
                f"{self.path}: gain {name!r} of [signals] {signal!r} is not a single number; "
                "name a scalar, a column that never changes, or write the number"
            )
        return float(values[0])

    @cached_property
    def _by_name(self) -> dict[str, str]:
        """Header by its name without a unit; the first of several."""
        return {split_header(header)[0]: header for header in reversed(self.names)}

    def _locate(self, name: str) -> tuple[str | None, int | None]:
        """The header that ``name`` means, and the index in it; (None, None) if there is none."""
        by_name, match = self._by_name, _ELEMENT.fullmatch(name)
        if name in self.arrays or name in self.problems or name in self.scalars:
            return name, None
        if name in by_name:
            return by_name[name], None
        if match and (match["name"] in self.arrays or match["name"] in by_name):
            return by_name.get(match["name"], match["name"]), int(match["index"])
        return None, None


def sorted_by_kind(path: Path, values: Mapping[str, object]) -> Columns:
    """Columns of what MATLAB and HDF5 hold: (n, 1) and (1, n) are columns, (1, 1) is a single number."""
    arrays: dict[str, np.ndarray] = {}
    scalars: dict[str, float] = {}
    problems: dict[str, str] = {}
    for name, value in values.items():
        array = np.squeeze(np.asarray(value))
        if array.dtype.kind not in "biuf":
            problems[name] = "holds no column or table of real numbers"
        elif array.ndim == 0:
            scalars[name] = float(array)
        elif array.ndim > 2 or array.size == 0:
            problems[name] = f"has shape {array.shape}; a column or a table of columns is wanted"
        else:
            arrays[name] = array
    return Columns(path, arrays, scalars, problems)
