"""CSV tables: comma, semicolon or tab; lines that start with ``#`` are comments.

The first row is the header, but where all its cells are numbers: columns are then called ``1``, ``2`` and so on. A cell
may hold a list in brackets, of the same length in every row: its column is then a table of columns.

pandas' C parser reads the whole file; only if a cell is not a number are the lines walked to say which one.
"""

import csv
import io
import json
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
        header, separator, table, bare = _table(path, data)
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
                lists = _lists(values)
                values = _numbers(data, separator, position, bare) if lists is None else lists
            except (ValueError, csv.Error) as error:
                problems[name] = str(error)
                continue
        arrays[name] = values
    if bare:
        notes.append(f"the first row is one of numbers: its {len(header)} columns are called 1 to {len(header)}")
    order = tuple(dict.fromkeys(header))
    return Columns(
        path,
        arrays,
        problems=problems,
        notes=tuple(notes),
        row=lambda index: _row_number(data, index - bare),
        order=order,
    )


def _is_bare(cells: list[str]) -> bool:
    """Whether a first row holds numbers where a header should be."""
    try:
        return bool([float(cell) for cell in cells])
    except ValueError:
        return False


def _lists(values: np.ndarray) -> np.ndarray | None:
    """A column of lists in brackets as a table (n_samples, k); None where it holds something else."""
    cells = [str(cell).strip() for cell in values]
    if not cells or not all(cell.startswith("[") and cell.endswith("]") for cell in cells):
        return None
    try:
        rows = json.loads("[" + ",".join(cells).replace("nan", "NaN") + "]")
        table = np.array(rows, np.float64)
    except (ValueError, RecursionError):
        table = np.empty(0)
    if table.ndim != 2 or not table.size:
        lengths = sorted({cell.count(",") + 1 for cell in cells})
        raise ValueError(f"holds lists in its cells, of {lengths[:3]} entries; as many numbers in every row are wanted")
    return table


def _table(path: Path, data: bytes) -> tuple[list[str], str, pd.DataFrame, bool]:
    """Header, separator, cells, whether there is no header; raises csv.Error for cells of over 131072 characters."""
    lines = _lines(data)
    _, first = next(lines, (0, ""))
    if not first:
        raise InputError(f"{path}: the file is empty; a header row and at least 2 rows of numbers are wanted")
    separator = max(",;\t", key=first.count)
    header = _cells(first, separator)
    check_count(path, len(header))
    bare = _is_bare(header)
    if bare:
        header = [str(k + 1) for k in range(len(header))]
    # pandas would take a first row that is too long for row labels; later ones it refuses itself
    if len(_cells(next(lines, (0, ""))[1], separator)) > len(header):
        raise InputError(f"{path}: {_long_row(data, separator, len(header))}")
    try:
        return header, separator, _parse(data, separator, header, bare), bare
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: {_long_row(data, separator, len(header))}") from error


def _parse(data: bytes, separator: str, header: list[str], bare: bool) -> pd.DataFrame:
    if (
        data.startswith(b"#") or b"\n#" in data or b"\r#" in data
    ):  # pandas' own comments would also cut cells such as #REF!
        data = "\n".join(line for _, line in _lines(data)).encode()
    return pd.read_csv(
        io.BytesIO(data),
        sep=separator,
        engine="c",
        header=None if bare else 0,
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


def _rows(data: bytes, separator: str, bare: bool = False) -> Iterator[tuple[int, list[str]]]:
    lines = _lines(data)
    if not bare:
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


def _numbers(data: bytes, separator: str, position: int, bare: bool) -> np.ndarray:
    """One column cell by cell; ValueError saying where the first text is."""
    values = []
    for number, cells in _rows(data, separator, bare):
        cell = cells[position] if position < len(cells) else ""
        try:
            values.append(np.nan if cell in _MISSING else float(cell.replace("_", " ")))  # Python reads 1_0 as 10
        except ValueError:
            mend = "decimals take a point" if "," in cell else "write a number, or leave the cell empty"
            raise ValueError(f"row {number} holds the text {cell!r}; {mend}") from None
    return np.array(values)
