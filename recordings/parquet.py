"""Parquet tables."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from .columns import Columns


def read(path: Path) -> Columns:
    """Read a Parquet table; null is a missing sample, a timestamp column becomes seconds since its epoch."""
    try:
        table = pq.ParquetFile(path).read()
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"{path}: cannot be read as Parquet; the file is damaged or of another format") from error
    arrays: dict[str, np.ndarray] = {}
    problems: dict[str, str] = {}
    notes = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        if name in arrays or name in problems:
            notes.append(f"column {name!r} appears again and is ignored there")
        elif pa.types.is_timestamp(column.type):
            stamps = column.cast(pa.timestamp("ns", column.type.tz)).to_numpy().astype("datetime64[ns]")
            arrays[name] = np.where(np.isnat(stamps), np.nan, stamps.astype(np.int64) / 1e9)
        elif pa.types.is_integer(column.type) or pa.types.is_floating(column.type):
            arrays[name] = column.cast(pa.float64(), safe=False).to_numpy()
        else:
            problems[name] = f"holds {column.type}, not numbers"
    return Columns(path, arrays, problems=problems, notes=tuple(notes))
