"""Damage that crashes SciPy's reader is found before SciPy sees the file; sound files of every kind pass."""

import io
import itertools
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.sparse

from snarelab.errors import InputError
from snarelab.recordings import read_recording
from snarelab.recordings.matlab_structure import check_structure


def saved(content, compressed=False):
    stream = io.BytesIO()
    scipy.io.savemat(stream, content, do_compression=compressed)
    return bytearray(stream.getvalue())


@pytest.mark.parametrize("compressed", [False, True])
def test_sound_files_pass(compressed):
    content = {
        "column": np.arange(4.0),
        "integers": np.arange(6, dtype=np.int16).reshape(2, 3),
        "complex": np.arange(3) * 1j,
        "empty": np.zeros((0, 0)),
        "flag": True,
        "text": "°C",
        "cell": np.array(["a", {"x": 1.0}], dtype=object),
        "structs": [{"a": 1.0}, {"a": np.arange(3.0)}],
        "nested": {"inner": {"value": 1.0}},
        "sparse": scipy.sparse.eye_array(4, format="csc"),
    }
    check_structure(Path("x.mat"), bytes(saved(content, compressed)))


# Offsets into the first array, at byte 128: class at 16, dimensions at 32, name "time" in one word, data at 48.
@pytest.mark.parametrize(
    ("offset", "value"),
    [
        (0, 13),
        (4, 1),
        (8, 5),
        (16, 5),
        (16, 99),
        (17, 9),
        (24, 9),
        (32, 7),
        (35, 255),
        (48, 0),
        (48, 64),
        (49, 5),
        (52, 1),
    ],
)
def test_damaged_arrays_are_refused(tmp_path, offset, value):
    data = saved({"time": np.arange(200.0), "q": {"j": np.arange(200.0)}})
    assert data[128 + 48] == 9  # double, where the damage is meant to go
    data[128 + offset] = value
    path = tmp_path / "run.mat"
    path.write_bytes(data)
    with pytest.raises(InputError, match="cannot be read as a MATLAB file"):
        read_recording(path)


def test_damage_inside_a_struct_is_refused():
    data = saved({"q": {"j": np.arange(200.0)}})
    field = data.index(b"\x0e\x00\x00\x00", 132)  # the matrix in the field
    for offset, value in itertools.product((8, 16, 48), (0, 19, 99, 255)):
        damaged = data.copy()
        damaged[field + offset] = value
        with pytest.raises(ValueError, match="does not fit"):
            check_structure(Path("x.mat"), bytes(damaged))
