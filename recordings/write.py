"""Writing a recording."""

from pathlib import Path

import pandas as pd
import xarray as xr

from ..errors import InputError
from ..extras import needed_for
from ..files import written_whole


def demand_suffix(path: str | Path) -> None:
    """Raise InputError for a suffix under which no recording is written, before any work."""
    suffix = Path(path).suffix
    if suffix.lower() not in (".csv", ".parquet"):
        raise InputError(f"{path}: a recording is written as .csv or .parquet, not {suffix!r}; change the suffix")
    if suffix.lower() == ".parquet":
        with needed_for(f"{path}: a Parquet file"):
            import pyarrow  # noqa: F401  what pandas writes it with


def write_recording(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a recording as CSV or Parquet, by the suffix of ``path``: time first, plain names, SI units, all digits.

    The file appears whole or not at all. Raises InputError for another suffix, or where the file cannot be written.
    """
    demand_suffix(path)
    write_frame(dataset.to_dataframe().reset_index(), Path(path))


def write_frame(table: pd.DataFrame, path: Path) -> None:
    """Write a table's columns, without its index, as CSV or Parquet, whole or not at all."""
    with written_whole(path) as part:
        if path.suffix.lower() == ".csv":
            table.to_csv(part, index=False, lineterminator="\n")
        else:
            table.to_parquet(part, index=False)
