"""Every mistake that a user can make gives one line that names the file, the place and the mend."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from refusal import refusal

from snarelab.errors import nearest
from snarelab.recordings import Signal, read_recording


def refused(path, *words, **arguments):
    refusal(lambda: read_recording(path, **arguments), path, *words)


def csv(folder, text, name="run.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


GOOD = "time,q.joint1,motor_current\n0,1,2\n1,2,3\n"


def test_missing_file(tmp_path):
    refused(tmp_path / "none.csv", "no such file")


def test_unknown_suffix(tmp_path):
    refused(csv(tmp_path, GOOD, "run.xlsx"), "'.xlsx'", ".csv", ".parquet", ".mat", ".h5", ".mcap", ".db3")


def test_missing_mapped_column(tmp_path):
    signals = {"tau.joint1": Signal("motor_curent", gain=2.0)}
    refused(csv(tmp_path, GOOD), "'motor_curent'", "3 columns", "'motor_current'", signals=signals)


def test_missing_gain(tmp_path):
    signals = {"tau.joint1": Signal("motor_current", gain="gtua")}
    refused(csv(tmp_path, GOOD), "gain 'gtua'", "nearest", signals=signals)


def test_gain_that_varies(tmp_path):
    signals = {"tau.joint1": Signal("motor_current", gain="motor_current")}
    refused(csv(tmp_path, GOOD), "gain 'motor_current'", "not a single number", signals=signals)


@pytest.mark.parametrize("gain", [0.0, float("nan")])
def test_gain_that_is_no_gain(tmp_path, gain):
    signals = {"tau.joint1": Signal("motor_current", gain=gain)}
    refused(csv(tmp_path, GOOD), "a number but 0 is wanted", signals=signals)


def test_mapped_name_that_is_no_signal(tmp_path):
    refused(csv(tmp_path, GOOD), "'torque.joint1'", "tau", signals={"torque.joint1": Signal("motor_current")})


def test_no_time(tmp_path):
    refused(csv(tmp_path, "t,Time,q.joint1\n0,0,1\n1,1,1\n"), "no column 'time'", 'column = "Time"', "[signals]")


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("t_ms", "ms"),
        ("time_us", "us"),
        ("stamp_ns", "ns"),
        ("t_min", "min"),
        ("t [ms]", "ms"),
        ("t", "s"),
        ("t_0", "s"),
    ],
)
def test_no_time_but_a_column_whose_name_says_its_unit(tmp_path, header, unit):
    said = f'"time" = {{ column = "{header}", unit = "{unit}" }}'
    path = csv(tmp_path, f"{header},q.joint1\n0,1\n1,1\n")
    refused(path, "no column 'time'", said)
    signals = {"time": Signal(header, unit), "q.joint1": Signal("q.joint1")}  # what is suggested, is read
    seconds = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}[unit]
    np.testing.assert_allclose(read_recording(path, signals)["time"], [0.0, seconds], rtol=1e-12)


def test_no_signal(tmp_path):
    refused(csv(tmp_path, "time,a,b\n0,1,2\n1,2,3\n"), "none of its 3 columns is a signal", "a, b")


def test_time_that_repeats(tmp_path):
    text = "# comment\ntime,q.j\n0,1\n\n0.25,2\n0.25,3\n"
    refused(csv(tmp_path, text), "time repeats in row 6", "0.25 s after 0.25 s")


def test_time_that_goes_backwards(tmp_path):
    refused(
        csv(tmp_path, "time [ms],q.j\n0,1\n300,2\n200,3\n"), "'time [ms]'", "backwards in row 4", "0.2 s after 0.3 s"
    )


def test_time_that_is_missing(tmp_path):
    refused(csv(tmp_path, "time,q.j\n0,1\n,2\n2,3\n"), "time is missing in row 3")


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("q.joint1 [N]", ("'N'", "does not fit q.joint1", "[mass]")),
        ("tau.joint1 [A]", ("'A'", "does not fit tau.joint1", "N*m")),
        ("temp.joint1 [C]", ("'C'", "does not fit temp.joint1", "degC")),
        ("tau.joint1 [newtonmeters]", ("'newtonmeters'", "unknown to pint")),
        ("tau.joint1 [3 N*m]", ("'3 N*m'", "unknown to pint")),
    ],
)
def test_units_that_do_not_fit(tmp_path, header, words):
    refused(csv(tmp_path, f"time,{header}\n0,1\n1,2\n"), repr(header), *words)


def test_unit_against_the_kind_of_joint(tmp_path):
    path = csv(tmp_path, "time,q.joint1 [mm]\n0,1\n1,2\n")
    refused(path, "'mm'", "does not fit q.joint1", "rad", joint_kinds={"joint1": "revolute"})


def test_units_of_one_joint_that_contradict(tmp_path):
    refused(csv(tmp_path, "time,q.j [mm],tau.j [N*m]\n0,1,1\n1,2,2\n"), "'tau.j [N*m]'", "does not fit tau.j")


def test_channel_without_a_number(tmp_path):
    refused(csv(tmp_path, "time,q.j,tau.j\n0,,1\n1,NaN,2\n"), "'q.j'", "no number in any of its 2 rows")


def test_infinite_sample(tmp_path):
    refused(csv(tmp_path, "time,q.j\n0,1\n1,inf\n2,1\n"), "'q.j'", "row 3 is infinite")


def test_stray_text(tmp_path):
    text = "# first line\ntime,note,q.j\n0,a,1\n\n# again\n1,b,2\n2,c,#REF!\n"
    refused(csv(tmp_path, text), "'q.j'", "row 7", "'#REF!'")


def test_decimal_comma(tmp_path):
    refused(csv(tmp_path, "time;q.j\n0,0;1,5\n0,1;2,5\n"), "'time'", "row 2", "'0,0'", "decimals take a point")


def test_row_that_is_too_long(tmp_path):
    refused(csv(tmp_path, "time,q.j\n0,1\n1,2\n2,3,4\n"), "row 4 has 3 cells and the header has 2")


def test_every_row_too_long(tmp_path):
    refused(csv(tmp_path, "time,q.j\n0,1,9\n1,2,9\n"), "row 2 has 3 cells and the header has 2")


def test_encoding(tmp_path):
    refused(csv(tmp_path, "time,temp.j [°C]\n0,1\n1,2\n", encoding="cp1252"), "not UTF-8")


@pytest.mark.parametrize("name", ["run.csv", "run.mat", "run.h5", "run.parquet"])
def test_empty_file(tmp_path, name):
    refused(csv(tmp_path, "", name), "the file is empty")


def test_only_comments(tmp_path):
    refused(csv(tmp_path, "# nothing\n\n"), "the file is empty")


@pytest.mark.parametrize("rows", ["", "0,1\n"])
def test_too_few_rows(tmp_path, rows):
    refused(csv(tmp_path, f"time,q.j\n{rows}"), "at least 2")


def test_lengths_that_differ(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.arange(5.0), "tau": {"j": np.arange(4.0)}, "q": {"j": np.arange(5.0)}})
    refused(path, "'tau/j'", "4 samples", "time has 5")


def test_scalar_as_a_column(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.arange(5.0), "gain": 2.0})
    refused(path, "'gain'", "single number", signals={"q.j": Signal("gain")})


def test_table_without_an_index(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.arange(5.0), "pos": np.zeros((5, 3))})
    refused(path, "'pos[0]'", signals={"q.j": Signal("pos")})
    refused(path, "columns 0 to 2", signals={"q.j": Signal("pos[3]")})


def test_text_in_matlab(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.arange(5.0), "q": {"j": "none"}})
    refused(path, "'q/j'", "no column or table of real numbers")


@pytest.mark.parametrize("keep", [60, 200, 700])
def test_damaged_matlab(tmp_path, keep):
    path = tmp_path / "run.mat"
    scipy.io.savemat(
        path, {"time": np.arange(100.0), "q": {"j": np.random.default_rng(0).normal(size=100)}}, do_compression=True
    )
    path.write_bytes(path.read_bytes()[:keep])
    refused(path, "cannot be read as a MATLAB file")


def test_damaged_matlab_inside(tmp_path):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.random.default_rng(0).normal(size=1000)}, do_compression=True)
    data = bytearray(path.read_bytes())
    data[1000:1400] = bytes(400)
    path.write_bytes(data)
    refused(path, "cannot be read as a MATLAB file")


@pytest.mark.parametrize("suffix", [".h5", ".hdf5"])
def test_damaged_hdf5(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(10000.0)
    path.write_bytes(path.read_bytes()[:1500])
    refused(path, "cannot be read as HDF5")


def test_damaged_parquet(tmp_path):
    path = tmp_path / "run.parquet"
    pd.DataFrame({"time": [0.0, 1.0], "q.j": [0.0, 1.0]}).to_parquet(path)
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    refused(path, "cannot be read as Parquet")
    path.write_bytes(data[:4] + bytes(60) + data[64:])
    refused(path, "cannot be read as Parquet")


def test_nearest():
    assert nearest("Motor_Curent", ["q", "motor_current", "motor_voltage"]) == "motor_current"
    assert nearest("x", []) == ""


@pytest.mark.parametrize(
    ("column", "values", "word"),
    [
        ("temp.joint1", ["", "", ""], "no number"),
        ("temp.joint1", [20, "inf", 20], "infinite"),
        ("temp.joint1 [C]", [20, 20, 20], "does not fit"),
        ("qd.joint1", ["nan"] * 3, "no number"),
        ("qdd.joint1 [parsec]", [1, 2, 3], "does not fit"),
        ("q.gripper", ["open", "open", "shut"], "open"),
        ("tau.gripper [A]", [1, 2, 3], "does not fit"),
    ],
)
def test_what_no_fit_of_a_model_needs_is_left_out_with_a_note(tmp_path, column, values, word):
    rows = "".join(f"{0.1 * k},{k},{2 * k},{x}\n" for k, x in enumerate(values))
    path = csv(tmp_path, f"time,q.joint1,tau.joint1,{column}\n{rows}")
    data = read_recording(path, {}, {"joint1": "revolute"})
    assert sorted(map(str, data.data_vars)) == ["q.joint1", "tau.joint1"]
    name = column.partition(" ")[0]
    (note,) = [n for n in data.attrs["notes"] if n.startswith(f"{name} is left out, no fit needs it: ")]
    assert word in note
    refused(path, word)  # read for itself, and where a model maps it
    refused(path, word, signals={name: Signal(column)})


def test_a_gain_counts_per_the_unit_beside_it(tmp_path):
    path = csv(tmp_path, "time,q.j,i [mA]\n0,1,500\n1,2,1500\n")
    data = read_recording(path, {"tau.j": Signal("i", unit="A", gain=4.0)})
    np.testing.assert_allclose(data["tau.j"], [2.0, 6.0])
    np.testing.assert_allclose(read_recording(path, {"tau.j": Signal("i", gain=4.0)})["tau.j"], [2000.0, 6000.0])
    refused(path, "unknown to pint", "banana", signals={"tau.j": Signal("i", unit="banana", gain=4.0)})
    refused(path, "does not fit unit = 'V'", signals={"tau.j": Signal("i", unit="V", gain=4.0)})


@pytest.mark.parametrize(
    ("column", "factor"),
    [("qdd.j [rad/s2]", 1.0), ("tau.j [N-m]", 1.0), ("tau.j [Nmm]", 1e-3), ("q.j [rev]", 2 * np.pi)],
)
def test_units_as_they_are_commonly_written(tmp_path, column, factor):
    data = read_recording(csv(tmp_path, f"time,{column}\n0,1\n1,2\n"))
    np.testing.assert_allclose(data[column.partition(" ")[0]], [factor, 2 * factor])
