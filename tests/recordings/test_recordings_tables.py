"""CSV and Parquet: values, units, what is tolerated, what is noted, what is written."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from snarelab.errors import InputError
from snarelab.recordings import Signal, read_recording, write_recording


def csv(folder, text, name="run.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def test_plain_names_are_si(tmp_path):
    data = read_recording(csv(tmp_path, "time,q.joint1,tau.joint1\n0,0.5,1\n0.5,0.25,-2\n"))
    assert data["time"].values.tolist() == [0.0, 0.5]
    assert data["q.joint1"].values.tolist() == [0.5, 0.25]
    assert data["tau.joint1"].attrs == {"unit": "N*m", "column": "tau.joint1"}
    assert all(data[name].dtype == np.float64 for name in data.variables)
    assert data.attrs["path"].endswith("run.csv")
    assert data.attrs["notes"] == []


@pytest.mark.parametrize(
    ("header", "factor", "offset", "unit"),
    [
        ("q.j [deg]", np.pi / 180, 0.0, "rad"),
        ("q.j [rad]", 1.0, 0.0, "rad"),
        ("qd.j [rpm]", np.pi / 30, 0.0, "rad/s"),
        ("qdd.j [deg/s²]", np.pi / 180, 0.0, "rad/s^2"),
        ("q.j [mm]", 1e-3, 0.0, "m"),
        ("q_link.j [°]", np.pi / 180, 0.0, "rad"),
        ("tau.j [mN*m]", 1e-3, 0.0, "N*m"),
        ("tau.j [N·m]", 1.0, 0.0, "N*m"),
        ("tau.j [Nm]", 1.0, 0.0, "N*m"),
        ("tau.j [lbf*ft]", 1.3558179483314004, 0.0, "N*m"),
        ("tau.j [kN]", 1e3, 0.0, "N"),
        ("tension.s1 [daN]", 10.0, 0.0, "N"),
        ("temp.j [degF]", 5 / 9, -160 / 9, "degC"),
        ("temp.j [K]", 1.0, -273.15, "degC"),
        ("temp.j [°C]", 1.0, 0.0, "degC"),
        ("pos.body.x [cm]", 1e-2, 0.0, "m"),
        ("quat.body.w [-]", 1.0, 0.0, "dimensionless"),
        ("angle.ring [deg]", np.pi / 180, 0.0, "rad"),
        ("force.tip.z [mN]", 1e-3, 0.0, "N"),
    ],
)
def test_units_of_headers(tmp_path, header, factor, offset, unit):
    raw = np.random.default_rng(1).uniform(-1000.0, 1000.0, 100)
    path = csv(tmp_path, "\n".join([f"time [ms],{header}", *(f"{k},{x!r}" for k, x in enumerate(raw.tolist()))]))
    data = read_recording(path)
    variable = data[header.split(" [")[0]]
    np.testing.assert_allclose(variable, factor * raw + offset, rtol=1e-12, atol=1e-10 if offset else 0.0)
    np.testing.assert_allclose(data["time"], np.arange(100) / 1000, rtol=1e-15)
    assert variable.attrs == {"unit": unit, "column": header}


def test_kind_of_a_joint_decides_its_units(tmp_path):
    path = csv(tmp_path, "time,q.slide,tau.slide,q.turn\n0,1,2,3\n1,2,3,4\n")
    data = read_recording(path, joint_kinds={"slide": "prismatic"})
    assert [data[name].attrs["unit"] for name in ("q.slide", "tau.slide", "q.turn")] == ["m", "N", "rad"]


def test_one_unit_tells_the_kind_of_the_whole_joint(tmp_path):
    data = read_recording(csv(tmp_path, "time,tau.slide,q.slide [mm]\n0,1,2\n1,2,3\n"))
    assert data["tau.slide"].attrs["unit"] == "N"


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_dialects(tmp_path, separator, end, encoding):
    rows = [
        "# by hand, 3 rows",
        "time, q.j [deg]",
        "0, 180",
        "",
        "# a pause; then",
        "1, NaN ",
        '2, "90"',
        "3, NA",
        "4, ",
        "5, nan",
    ]
    text = end.join(row if row.startswith("#") else row.replace(",", separator) for row in rows)
    data = read_recording(csv(tmp_path, text, encoding=encoding))
    np.testing.assert_allclose(data["q.j"], [np.pi, np.nan, np.pi / 2, np.nan, np.nan, np.nan])
    assert data["time"].values.tolist() == [0, 1, 2, 3, 4, 5]


def test_mapped_signals_win_over_names(tmp_path):
    path = csv(tmp_path, "t,tau.j,current [A],ratio,q.j\n0,99,1,35.5,0\n100,99,2,35.5,1\n")
    signals = {
        "time": Signal("t", unit="ms"),
        "tau.j": Signal("current", unit="A", gain=10.0),
        "q.j": Signal("q.j", "deg"),
    }
    data = read_recording(path, signals)
    assert data["time"].values.tolist() == [0.0, 0.1]
    assert data["tau.j"].values.tolist() == [10.0, 20.0]
    assert data["tau.j"].attrs == {"unit": "N*m", "column": "current [A]"}
    assert data["q.j"].values[1] == pytest.approx(np.pi / 180)
    assert any("'tau.j' is ignored" in note for note in data.attrs["notes"])
    by_name = read_recording(path, signals | {"tau.j": Signal("current [A]", gain="ratio")})
    assert by_name["tau.j"].values.tolist() == [35.5, 71.0]


def test_notes_say_what_was_seen(tmp_path):
    rows = [f"{t},{t if k != 3 else ''},{k},x" for k, t in enumerate([0.0, 0.1, 0.2, 0.3, 0.4, 0.9, 1.0, 1.1, 1.2])]
    path = csv(tmp_path, "\n".join(["time,q.j,q.j,remark", *rows]))
    notes = " | ".join(read_recording(path).attrs["notes"])
    assert "'q.j' appears again as column 3" in notes
    assert "no signal has such a name: remark" in notes
    assert "q.j: 1 of 9 samples are missing" in notes
    assert "gap of 0.2 s from 0.2 s to 0.4 s" in notes
    assert "gap of 0.5 s from 0.4 s to 0.9 s" in notes
    assert "uneven" not in notes


def test_uneven_sampling_is_noted_with_numbers(tmp_path):
    times = [0.0, 0.1, 0.2, 0.32, 0.4, 0.5]
    path = csv(tmp_path, "\n".join(["time,q.j", *(f"{t},1" for t in times)]))
    assert read_recording(path).attrs["notes"] == ["uneven sampling: median period 0.1 s, steps off by up to 20 %"]


def test_many_gaps_are_summed_up(tmp_path):
    times = np.arange(300) + np.arange(300) // 10
    notes = read_recording(csv(tmp_path, "\n".join(["time,q.j", *(f"{t},1" for t in times)]))).attrs["notes"]
    assert len(notes) == 21
    assert notes[-1] == "29 gaps in all, 58 s of 328 s"


def test_parquet_of_pandas(tmp_path):
    path = tmp_path / "run.parquet"
    table = pd.DataFrame(
        {"q.j [deg]": pd.array([180, None, 90], dtype="Int64"), "tau.j": np.array([0.5, 1, 2], np.float32), "who": "me"}
    )
    table.index = pd.Index([0.0, 0.1, 0.2], name="time")
    table.to_parquet(path)
    data = read_recording(path)
    np.testing.assert_allclose(data["q.j"], [np.pi, np.nan, np.pi / 2])
    assert data["tau.j"].values.tolist() == [0.5, 1.0, 2.0]
    assert "no signal has such a name: who" in data.attrs["notes"][0]


@pytest.mark.parametrize("resolution", ["s", "ms", "us", "ns"])
def test_parquet_timestamps_become_seconds(tmp_path, resolution):
    stamps = pd.to_datetime(["2024-05-01T00:00:00", "2024-05-01T00:00:01", "2024-05-01T00:00:02"]).as_unit(resolution)
    path = tmp_path / "run.parquet"
    pd.DataFrame({"time": stamps, "q.j": [1.0, 2.0, 3.0]}).to_parquet(path)
    assert read_recording(path)["time"].values.tolist() == [1714521600.0, 1714521601.0, 1714521602.0]


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_written_recordings_come_back_to_the_last_bit(tmp_path, suffix):
    random = np.random.default_rng(3)
    time = 1.7e9 + np.cumsum(random.uniform(1e-3, 2e-3, 500))
    values = random.normal(size=(2, 500)) * 10.0 ** random.integers(-12, 12, (2, 500))
    values[0, 7] = np.nan
    data = xr.Dataset({"q.j": ("time", values[0]), "tau.j": ("time", values[1])}, {"time": time})
    path = tmp_path / f"run{suffix}"
    write_recording(data, path)
    back = read_recording(path)
    for name in ("time", "q.j", "tau.j"):
        np.testing.assert_array_equal(back[name].values, data[name].values)
    assert list(tmp_path.iterdir()) == [path]
    table = pd.read_csv(path) if suffix == ".csv" else pd.read_parquet(path)
    assert list(table.columns) == ["time", "q.j", "tau.j"]


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    data = xr.Dataset({"q.j": ("time", [1.0, 2.0])}, {"time": [0.0, 1.0]})
    path = csv(tmp_path, "precious")

    def full_disk(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pd.DataFrame, "to_csv", full_disk)
    with pytest.raises(InputError, match="No space left on device"):
        write_recording(data, path)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_other_suffixes_are_not_written(tmp_path):
    with pytest.raises(InputError, match=r"written as \.csv or \.parquet, not '\.mat'"):
        write_recording(xr.Dataset({"q.j": ("time", [1.0])}, {"time": [0.0]}), tmp_path / "run.mat")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="cannot be written"):
        write_recording(xr.Dataset({"q.j": ("time", [1.0])}, {"time": [0.0]}), tmp_path / "missing" / "run.csv")
