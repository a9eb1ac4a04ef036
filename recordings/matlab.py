"""MATLAB files: version 4 to 7 through SciPy, version 7.3 (which is HDF5) through h5py.

Variables are columns or single numbers, fields of a struct are ``"struct/field"``.
"""

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy.io
from scipy.io.matlab import mat_struct

from ..errors import InputError
from ..files import content
from .columns import LARGEST, Columns, sorted_by_kind
from .hdf5 import datasets, is_hdf5
from .matlab_structure import check_structure


def read(path: Path) -> Columns:
    """Read every numeric variable of a MATLAB file; cells, objects and struct arrays cannot be columns."""
    if is_hdf5(path):
        return sorted_by_kind(path, datasets(path, matlab=True))
    try:
        data = content(path, LARGEST)
        check_structure(path, data)
        found = scipy.io.loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a damaged file makes SciPy raise anything from TypeError to zlib.error
        raise InputError(f"{path}: cannot be read as a MATLAB file; it is damaged or of another format") from error
    variables = {name: value for name, value in found.items() if isinstance(name, str) and not name.startswith("__")}
    return sorted_by_kind(path, dict(_flat(variables)))


def _flat(variables: dict[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    for name, value in variables.items():
        if isinstance(value, mat_struct):
            inside = {field: inner for field, inner in vars(value).items() if field != "_fieldnames"}  # SciPy's own
            yield from _flat(inside, f"{prefix}{name}/")
        elif isinstance(value, (np.ndarray, np.generic, int, float)):
            yield f"{prefix}{name}", value
        else:
            yield f"{prefix}{name}", np.array(None, dtype=object)
