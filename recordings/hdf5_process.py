"""Reads an HDF5 file in a separate process, as a script: ``python hdf5_process.py FILE MOST [matlab]``.

The HDF5 library never returns from some damaged files and crashes on others (seen with HDF5 2.0); a process can be
ended. Pickled on standard output: the datasets by name, or the text of a refusal. Nothing of snarelab is imported, so
that it starts in a moment.
"""

import pickle
import sys
from collections.abc import Iterator

import h5py
import numpy as np

_DEEPEST = 32


class Refusal(Exception):
    """An error that a user can correct."""


def collect(path: str, most: int, matlab: bool) -> dict[str, np.ndarray]:
    """All datasets by their path in the file, of ``most`` bytes together, and the file's own single numbers.

    What is no column is an array of object.
    """
    found: dict[str, np.ndarray] = {}
    size = 0
    with h5py.File(path, "r") as file:
        for name, item in _inside(file, "", set()):
            if matlab and name.startswith("#"):
                continue
            elsewhere = item.is_virtual or item.external is not None
            number = item.ndim <= 2 and item.dtype.kind in "biuf" and not elsewhere
            if not number or _text(item.attrs.get("MATLAB_class")) == "char":
                found[name] = np.array(None, dtype=object)
                continue
            size += item.size * item.dtype.itemsize
            if size > most:
                raise Refusal(
                    f"unpacks to {size / 2**30:.1f} GiB of numbers and at most {most >> 30} are read; "
                    "it is damaged, or cut it into parts"
                )
            unit = _text(item.attrs.get("unit", item.attrs.get("units")))
            values = np.asarray(item[()])
            found[f"{name} [{unit}]" if unit else name] = values.T if matlab else values
        for name, value in file.attrs.items():  # single numbers are often kept there
            if np.ndim(value) == 0 and np.asarray(value).dtype.kind in "biuf":
                found.setdefault(name, np.asarray(value))
    return found


def _inside(group: h5py.Group, name: str, seen: set[int]) -> Iterator[tuple[str, h5py.Dataset]]:
    """Datasets of a group and of the groups in it, each object once; h5py's own walk is slow where groups lie deep."""
    if name.count("/") > _DEEPEST:
        raise Refusal(f"has groups more than {_DEEPEST} deep; store the columns flatter")
    for key in group:
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        item = group[key]
        address = h5py.h5o.get_info(item.id).addr  # pyright: ignore[reportAttributeAccessIssue]
        if address in seen:
            continue
        seen.add(address)
        if isinstance(item, h5py.Group):
            yield from _inside(item, f"{name}{key}/", seen)
        elif isinstance(item, h5py.Dataset):
            yield f"{name}{key}", item


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else value if isinstance(value, str) else ""


if __name__ == "__main__":
    try:
        result: object = collect(sys.argv[1], int(sys.argv[2]), len(sys.argv) > 3)
    except Refusal as refused:
        result = str(refused)
    except Exception as error:  # a damaged file makes h5py raise anything from TypeError to SystemError
        result = error.__class__
    pickle.dump(result, sys.stdout.buffer, protocol=5)
