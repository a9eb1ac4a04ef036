"""HDF5 files: datasets are columns, groups are folders (``"arm/current"``), a dataset's attribute ``unit`` its unit."""

from pathlib import Path

import h5py
import numpy as np

from ..errors import InputError
from .columns import Columns, sorted_by_kind


def read(path: Path) -> Columns:
    """Read every numeric dataset of an HDF5 file."""
    return sorted_by_kind(path, datasets(path))


def datasets(path: Path, matlab: bool = False) -> dict[str, object]:
    """All datasets by their path in the file; what is no column (text, images) is left as None.

    MATLAB 7.3 stores arrays transposed and text as integers: ``matlab`` undoes the first and marks the second.
    """
    found: dict[str, object] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if not isinstance(item, h5py.Dataset) or (matlab and name.startswith("#")):
            return
        if item.ndim > 2 or item.dtype.kind not in "biuf" or _text(item.attrs.get("MATLAB_class")) == "char":
            found[name] = np.array(None, dtype=object)
            return
        unit = _text(item.attrs.get("unit", item.attrs.get("units")))
        values = np.asarray(item[()])
        found[f"{name} [{unit}]" if unit else name] = values.T if matlab else values

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as HDF5; the file is damaged or of another format") from error
    return found


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else value if isinstance(value, str) else ""
