"""MATLAB and HDF5 files as other programs write them, and the measured EMPS files."""

import h5py
import numpy as np
import pytest
import scipy.io

from snarelab.recordings import Signal, read_recording

TIME = np.array([0.0, 0.1, 0.2, 0.3])
TABLE = np.arange(24.0).reshape(4, 6)
MAPPING = {
    "time": Signal("t", unit="s"),
    "q.a": Signal("log/pos[2]", unit="deg"),
    "q.b": Signal("log/across[1]"),
    "tau.a": Signal("current", unit="A", gain="drive/ratio[1]"),
    "tau.b": Signal("current", gain="k"),
}


def check(data):
    np.testing.assert_array_equal(data["time"], TIME)
    np.testing.assert_allclose(data["q.a"], np.deg2rad(TABLE[:, 2]), rtol=1e-14)
    np.testing.assert_array_equal(data["q.b"], TABLE[:, 1])
    np.testing.assert_array_equal(data["tau.a"], [20.0, 40.0, 60.0, 80.0])
    np.testing.assert_array_equal(data["tau.b"], [0.5, 1.0, 1.5, 2.0])
    np.testing.assert_array_equal(data["qd.a"], [4.0, 3.0, 2.0, 1.0])
    assert data["q.a"].attrs["column"] == "log/pos"
    assert data["qd.a"].attrs == {"unit": "rad/s", "column": "qd/a"}
    assert all(data[name].dtype == np.float64 for name in data.variables)
    assert any("such a name: remark" in note and "pos" not in note for note in data.attrs["notes"])


def test_matlab_5(tmp_path):
    path = tmp_path / "run.mat"
    content = {
        "t": TIME[:, None],
        "current": np.array([[1, 2, 3, 4]], dtype=np.int16),
        "k": 0.5,
        "log": {"pos": TABLE, "across": TABLE.T},
        "drive": {"ratio": [10.0, 20.0]},
        "qd": {"a": [4.0, 3.0, 2.0, 1.0]},
        "remark": "warm-up",
    }
    scipy.io.savemat(path, content)
    check(read_recording(path, MAPPING))


def test_hdf5(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["t"] = TIME
        file["current"] = np.array([1, 2, 3, 4], dtype=np.int32)[None]
        file["k"] = 0.5
        file["log/pos"] = TABLE
        file["log/across"] = TABLE.T
        file["drive/ratio"] = [10.0, 20.0]
        file["qd/a"] = np.array([4, 3, 2, 1], dtype=np.float32)
        file["remark"] = "warm-up"
    check(read_recording(path, MAPPING))


def test_matlab_73(tmp_path):
    """Version 7.3 is HDF5 with a 512-byte preamble, arrays transposed, and text as 16-bit integers."""
    path = tmp_path / "run.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = TIME[None]
        file["current"] = np.array([[1.0], [2.0], [3.0], [4.0]])
        file["k"] = [[0.5]]
        file["log/pos"] = TABLE.T
        file["log/across"] = TABLE
        file["drive/ratio"] = [[10.0, 20.0]]
        file["qd/a"] = [[4.0, 3.0, 2.0, 1.0]]
        file["remark"] = np.frombuffer("warm".encode("utf-16-le"), dtype=np.uint16)
        file["remark"].attrs["MATLAB_class"] = np.bytes_("char")
        file["#refs#/a"] = np.zeros(4)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    check(read_recording(path, MAPPING))


def test_square_tables_keep_matlab_columns(tmp_path):
    square = np.arange(16.0).reshape(4, 4)
    scipy.io.savemat(tmp_path / "5.mat", {"t": TIME, "q": square})
    with h5py.File(tmp_path / "73.mat", "w") as file:
        file["t"], file["q"] = TIME[None], square.T
    for name in ("5.mat", "73.mat"):
        data = read_recording(tmp_path / name, {"time": Signal("t"), "q.a": Signal("q[3]")})
        assert data["q.a"].values.tolist() == [3.0, 7.0, 11.0, 15.0]


def test_time_in_a_table(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"data": np.column_stack([1000.0 * TIME, [1.0, 2.0, 3.0, np.nan]])})
    data = read_recording(path, {"time": Signal("data[0]", unit="ms"), "q.a": Signal("data[1]")})
    np.testing.assert_allclose(data["time"], TIME, rtol=1e-14)
    np.testing.assert_array_equal(data["q.a"], [1.0, 2.0, 3.0, np.nan])


def test_units_as_hdf5_attributes(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        file["q.a"] = [180.0, 0.0, 0.0, 0.0]
        file["q.a"].attrs["unit"] = "deg"
    assert read_recording(path)["q.a"].values[0] == pytest.approx(np.pi)


@pytest.mark.parametrize("name", ["DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"])
def test_emps(name, emps):
    """The published facts: 1 kHz, 24.84 s, force = 35.15 N/V times the controller's volts (Janot et al., 2019)."""
    signals = {
        "time": Signal("t", unit="s"),
        "q.slide": Signal("qm", unit="m"),
        "tau.slide": Signal("vir", unit="V", gain="gtau"),
    }
    data = read_recording(emps / name, signals, {"slide": "prismatic"})
    assert data.sizes["time"] == 24841
    assert np.median(np.diff(data["time"])) == pytest.approx(1e-3, rel=1e-4)
    assert data["time"].values[-1] == pytest.approx(24.84)
    assert data["q.slide"].attrs["unit"] == "m"
    assert data["tau.slide"].attrs == {"unit": "N", "column": "vir"}
    volts = scipy.io.loadmat(emps / name)["vir"][:, 0]
    np.testing.assert_allclose(data["tau.slide"], 35.15 * volts, rtol=1e-4)  # published rounded
    assert not any(np.isnan(values).any() for values in data.data_vars.values())
    assert not any("gap" in note or "missing" in note for note in data.attrs["notes"])


def test_single_numbers_of_an_hdf5_file_serve_as_gains(tmp_path):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["time"], file["q.j"], file["i"] = np.arange(3.0), np.zeros(3), np.array([1.0, 2.0, 3.0])
        file.attrs["gtau"], file.attrs["by"] = 35.15, "nobody"
    data = read_recording(tmp_path / "r.h5", {"tau.j": Signal("i", unit="V", gain="gtau")})
    np.testing.assert_allclose(data["tau.j"], [35.15, 70.3, 105.45])
