"""Parquet tables."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..extras import needed_for
from .columns import Columns, check_size

with needed_for("a Parquet file"):
    import pyarrow as pa
    import pyarrow.parquet as pq


def read(path: Path) -> Columns:
    """Read a Parquet table; null is a missing sample, a timestamp column becomes seconds since its epoch.

    Columns of other types, nested ones among them, are named and not read.
    """
    arrays: dict[str, np.ndarray] = {}
    notes = []
    try:
        with pq.ParquetFile(path) as file:
            schema = file.schema_arrow
            check_size(path, 8 * file.metadata.num_rows * len(schema))
            table = file.read([field.name for field in schema if _is_number(field.type)])
        for name, column in zip(table.column_names, table.columns, strict=True):
            if name in arrays:
                notes.append(f"column {name!r} appears again and is ignored there")
            elif _is_number(column.type):
                arrays[name] = _values(column)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a damaged file makes pyarrow raise anything from KeyError to UnicodeDecodeError
        raise InputError(f"{path}: cannot be read as Parquet; the file is damaged or of another format") from error
    problems = {f.name: f"holds {str(f.type)[:80]}, not numbers" for f in schema if f.name not in arrays}
    return Columns(path, arrays, problems=problems, notes=tuple(notes))


def _is_number(kind: pa.DataType) -> bool:
    return pa.types.is_timestamp(kind) or pa.types.is_integer(kind) or pa.types.is_floating(kind)


def _values(column: pa.ChunkedArray) -> np.ndarray:
    if not pa.types.is_timestamp(column.type):
        return column.cast(pa.float64(), safe=False).to_numpy()
    stamps = column.cast(pa.timestamp("ns", column.type.tz)).to_numpy().astype("datetime64[ns]")
    return np.where(np.isnat(stamps), np.nan, stamps.astype(np.int64) / 1e9)
