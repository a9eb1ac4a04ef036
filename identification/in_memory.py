"""Recordings in memory, put where those that are read from files are."""

import json
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from ..errors import InputError
from ..recordings import write_frame

RecordingLike: TypeAlias = str | Path | xr.Dataset | pd.DataFrame
"""A recording's path, or a table in memory with the columns that a file would have."""


@contextmanager
def as_files(recordings: Sequence[RecordingLike]) -> Iterator[list[str | Path]]:
    """Every recording as a path; tables in memory stand in a folder of their own for as long as they are read.

    The same object is the same file, so that a holdout which is also fitted is refused as ever.
    """
    with tempfile.TemporaryDirectory(prefix="snarelab-") as folder:
        written: dict[int, str | Path] = {}
        for k, recording in enumerate(recordings, 1):
            if id(recording) in written:
                continue
            if isinstance(recording, str | Path):
                written[id(recording)] = recording
                continue
            if isinstance(recording, xr.Dataset):
                table = recording.to_dataframe().reset_index()
            elif isinstance(recording, pd.DataFrame):
                table = recording.reset_index() if recording.index.name else recording
            else:
                raise InputError(
                    f"recording {k}: is a {type(recording).__name__}; give a path, an xarray.Dataset or a "
                    "pandas.DataFrame"
                )
            path = Path(folder) / f"recording {k}.csv"
            try:
                write_frame(_numbers(table), path)
            except (ValueError, TypeError) as error:
                said = " ".join(str(error).split())
                raise InputError(f"recording {k}: is no table of numbers: {said}; give a column a signal") from None
            written[id(recording)] = path
        try:
            yield [written[id(recording)] for recording in recordings]
        except InputError as error:
            # The caller knows no file; a recording's number is its place among all that were given.
            raise InputError(re.sub(rf"{re.escape(folder)}/(recording \d+)\.csv", r"\1", str(error))) from None


def _numbers(table: pd.DataFrame) -> pd.DataFrame:
    """Every column as numbers, stamps as seconds since their epoch, lists as a CSV file has them; ValueError or
    TypeError where one is none of these."""
    columns: dict[str, np.ndarray] = {}
    for position, name in enumerate(table.columns):
        if not isinstance(name, str):
            raise TypeError(f"column {name!r} has no name")
        values = table.iloc[:, position]
        if pd.api.types.is_datetime64_any_dtype(values):
            since = values.dt.tz_convert(None) if values.dt.tz is not None else values
            columns.setdefault(name, (since - pd.Timestamp(0)).dt.total_seconds().to_numpy())
        elif not pd.api.types.is_numeric_dtype(values) and len(values) and all(map(_is_list, values)):
            columns.setdefault(name, np.array([_list_text(cell) for cell in values], object))
        else:
            columns.setdefault(name, values.to_numpy(dtype=float, na_value=np.nan))
    return pd.DataFrame(columns)


def _is_list(cell: object) -> bool:
    """Whether a cell holds several numbers: a list, a tuple, an array, or the text of a list."""
    written = isinstance(cell, str) and cell.strip().startswith("[")
    return written or isinstance(cell, list | tuple) or (isinstance(cell, np.ndarray) and cell.ndim == 1)


def _list_text(cell: object) -> str:
    return cell if isinstance(cell, str) else json.dumps([float(x) for x in cell])  # type: ignore[attr-defined]  one of `_is_list`
