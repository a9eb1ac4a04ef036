"""Writing a recording."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import xarray as xr

from ..errors import InputError
from ..files import written_whole


def demand_suffix(path: str | Path) -> None:
    """Refuse a name that no recording is written under (InputError), before there is anything to write."""
    suffix = Path(path).suffix
    if suffix.lower() not in (".csv", ".parquet"):
        raise InputError(f"{path}: a recording is written as .csv or .parquet, not {suffix!r}; change the suffix")


def write_recording(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a recording as CSV or Parquet, by the suffix of ``path``: time first, plain names, SI units, all digits.

    The file appears whole or not at all. Raises InputError for another suffix, or where the file cannot be written.
    """
    demand_suffix(path)
    path = Path(path)
    table = dataset.to_dataframe().reset_index()
    with written_whole(path) as part:
        if path.suffix.lower() == ".csv":
            table.to_csv(part, index=False, lineterminator="\n")
        else:
            pq.write_table(pa.Table.from_pandas(table, preserve_index=False), part)
