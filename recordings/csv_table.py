"""CSV tables: comma, semicolon or tab; one header row; lines that start with ``#`` are comments.

pandas' C parser reads the whole file; only if a cell is not a number are the lines walked to say which one.
"""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import InputError
from ..files import content
from .columns import LARGEST, Columns, check_count

_WALKED = 1 << 30
"""Bytes of lines that are walked to say where text stands among numbers; a walk for each column with text."""

_MISSING = ("", "NaN", "nan", "NA")


def read(path: Path) -> Columns:
    """Read a CSV table. Empty cells, NaN, nan and NA are missing samples.

    Raises InputError for an empty file, a text encoding other than UTF-8, and rows longer than the header.
    """
    data = content(path, LARGEST).removeprefix(b"\xef\xbb\xbf")
    try:
        if not data.isascii():
            data.decode()
        header, separator, table = _table(path, data)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not UTF-8 text ({error.reason} at byte {error.start}); save it as UTF-8"
        ) from error
    except csv.Error as error:
        raise InputError(f"{path}: is not a table that can be read ({error}); check its quotes") from error
    arrays: dict[str, np.ndarray] = {}
    problems: dict[str, str] = {}
    notes = []
    walks = max(20, _WALKED // len(data))
    for position, name in enumerate(header):
        if name in arrays or name in problems:
            notes.append(f"column {name!r} appears again as column {position + 1} and is ignored there")
            continue
        values = np.asarray(table[position])
        if values.dtype.kind not in "iuf":
            walks -= 1
            if walks < 0:
                problems[name] = "holds text; write numbers, or leave cells empty"
                continue
            try:
                values = _numbers(data, separator, position)
            except (ValueError, csv.Error) as error:
                problems[name] = str(error)
                continue
        arrays[name] = values
    return Columns(path, arrays, problems=problems, notes=tuple(notes), row=lambda index: _row_number(data, index))


def _table(path: Path, data: bytes) -> tuple[list[str], str, pd.DataFrame]:
    """Header, separator and cells; raises csv.Error for a cell of more than 131072 characters."""
    lines = _lines(data)
    _, first = next(lines, (0, ""))
    if not first:
        raise InputError(f"{path}: the file is empty; a header row and at least 2 rows of numbers are wanted")
    separator = max(",;\t", key=first.count)
    header = _cells(first, separator)
    check_count(path, len(header))
    # pandas would take a first row that is too long for row labels; later ones it refuses itself
    if len(_cells(next(lines, (0, ""))[1], separator)) > len(header):
        raise InputError(f"{path}: {_long_row(data, separator, len(header))}")
    try:
        return header, separator, _parse(data, separator, header)
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: {_long_row(data, separator, len(header))}") from error


def _parse(data: bytes, separator: str, header: list[str]) -> pd.DataFrame:
    if (
        data.startswith(b"#") or b"\n#" in data or b"\r#" in data
    ):  # pandas' own comments would also cut cells such as #REF!
        data = "\n".join(line for _, line in _lines(data)).encode()
    return pd.read_csv(
        io.BytesIO(data),
        sep=separator,
        engine="c",
        header=0,
        names=list(range(len(header))),
        na_values=list(_MISSING),
        keep_default_na=False,
        skipinitialspace=True,
        low_memory=False,
    )


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Row number, counted as a person counts the file's lines, and text of each line that is not blank or a comment."""
    for number, line in enumerate(io.TextIOWrapper(io.BytesIO(data), encoding="utf-8"), start=1):
        if line.strip(" \r\n") and not line.startswith("#"):
            yield number, line.rstrip("\n")


def _cells(line: str, separator: str) -> list[str]:
    """Cells of a line; raises csv.Error for one of more than 131072 characters."""
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]


def _rows(data: bytes, separator: str) -> Iterator[tuple[int, list[str]]]:
    lines = _lines(data)
    next(lines)
    return ((number, _cells(line, separator)) for number, line in lines)


def _row_number(data: bytes, index: int) -> int:
    lines = _lines(data)
    for _ in range(index + 1):
        next(lines)
    return next(lines)[0]


def _long_row(data: bytes, separator: str, width: int) -> str:
    for number, cells in _rows(data, separator):
        if len(cells) > width:
            commas = ", or separate columns by ';' where numbers have decimal commas" if separator == "," else ""
            return f"row {number} has {len(cells)} cells and the header has {width}; mend that row{commas}"
    return "is not a table that can be read; check its quotes"


def _numbers(data: bytes, separator: str, position: int) -> np.ndarray:
    """One column cell by cell; ValueError saying where the first text is."""
    values = []
    for number, cells in _rows(data, separator):
        cell = cells[position] if position < len(cells) else ""
        try:
            values.append(np.nan if cell in _MISSING else float(cell.replace("_", " ")))  # Python reads 1_0 as 10
        except ValueError:
            mend = "decimals take a point" if "," in cell else "write a number, or leave the cell empty"
            raise ValueError(f"row {number} holds the text {cell!r}; {mend}") from None
    return np.array(values)
