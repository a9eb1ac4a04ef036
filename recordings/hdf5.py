"""HDF5 files: datasets are columns, groups are folders (``"arm/current"``), a dataset's attribute ``unit`` its unit."""

import pickle
import subprocess
import sys
import threading
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..extras import needed_for
from .columns import LARGEST, Columns, sorted_by_kind

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""HDF5 File Format Specification 3.0, section II.A."""

PATIENCE = 30.0
"""Longest that a file may take to be read [s], and 1 s more for each 4 MB of it."""


def read(path: Path) -> Columns:
    """Read every numeric dataset of an HDF5 file."""
    return sorted_by_kind(path, datasets(path))


def is_hdf5(path: Path) -> bool:
    """Whether a file bears HDF5's signature: at its start, or after a block of 512, 1024, ... bytes."""
    size, place = path.stat().st_size, 0
    with path.open("rb") as file:
        while place + len(_SIGNATURE) <= size:
            file.seek(place)
            if file.read(len(_SIGNATURE)) == _SIGNATURE:
                return True
            place = max(512, 2 * place)
    return False


def datasets(path: Path, matlab: bool = False) -> dict[str, np.ndarray]:
    """All datasets by their path in the file; what is no column (text, images) is an array of objects.

    Links to other files are not followed, and data that lies in other files is left as None. MATLAB 7.3 stores arrays
    transposed and text as integers: ``matlab`` undoes the first and marks the second. A process of its own reads the
    file, see `hdf5_process`; the first sight of it costs a quarter of a second.
    """
    with needed_for(f"{path}: an HDF5 file"):
        if find_spec("h5py") is None:
            raise ModuleNotFoundError(name="h5py")
    script = str(Path(__file__).with_name("hdf5_process.py"))
    command = [sys.executable, "-P", script, str(path.resolve()), str(LARGEST), *(["matlab"] if matlab else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
    watch = threading.Timer(PATIENCE + path.stat().st_size / 4e6, process.kill)
    watch.start()
    try:
        assert process.stdout is not None
        found = pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError):
        found = None  # it crashed, or was ended
    finally:
        watch.cancel()
        process.kill()
        process.communicate()
    if isinstance(found, str):
        raise InputError(f"{path}: {found}")
    if not isinstance(found, dict):
        raise InputError(f"{path}: cannot be read as HDF5; the file is damaged or of another format")
    return found
