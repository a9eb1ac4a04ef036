"""Recordings as they are logged: mixes, offsets, columns by number, lists in cells, no clock, no torque."""

import json

import numpy as np
import pandas as pd
import pytest
from refusal import refusal

from snarelab.cli import main
from snarelab.errors import InputError
from snarelab.identification.fitting.held_out import demand_apart
from snarelab.models.model_file import load_model
from snarelab.models.model_write import save_model
from snarelab.recordings import JointKind, Signal, read_recording

KINDS: dict[str, JointKind] = {"a": "revolute", "b": "revolute"}


def csv(folder, text, name="run.csv"):
    path = folder / name
    path.write_text(text)
    return path


def test_a_mix_of_columns_with_an_offset_before_unit_and_gain(tmp_path):
    path = csv(tmp_path, "time,c5 [mA],c6 [mA],p5 [deg]\n0,1000,200,90\n1,2000,-100,180\n")
    signals = {
        "tau.a": Signal("", "A", 2.0, {"c5": 45.0, "c6": -32.0}, offset=1000.0),
        "q.a": Signal("p5", offset=-90.0),
    }
    data = read_recording(path, signals, KINDS)
    # (45 * 1000 - 32 * 200 + 1000) mA are 39.6 A
    np.testing.assert_allclose(data["tau.a"], 2 * np.array([39.6, 45 * 2.0 + 3.2 + 1.0]))
    np.testing.assert_allclose(data["q.a"], [0.0, np.pi / 2])
    assert data["tau.a"].attrs["column"] == "45*c5 - 32*c6 + 1000 [mA]"
    assert not any("ignored" in note for note in data.attrs["notes"])


def test_a_file_without_a_header_has_numbered_columns(tmp_path):
    path = csv(tmp_path, "0.00, 4.0, 0.1\n0.01, -4.0, 0.2\n0.02, 4.0, 0.3\n")
    signals = {"time": Signal(1), "tau.a": Signal(2, gain=3.0), "q.a": Signal(3)}
    data = read_recording(path, signals, KINDS)
    np.testing.assert_array_equal(data["time"], [0.0, 0.01, 0.02])
    np.testing.assert_array_equal(data["tau.a"], [12.0, -12.0, 12.0])
    np.testing.assert_array_equal(data["q.a"], [0.1, 0.2, 0.3])
    assert "the first row is one of numbers: its 3 columns are called 1 to 3" in data.attrs["notes"]
    with pytest.raises(InputError, match=r"'q.a' is column number 4; the file has 3: 1 to 3"):
        read_recording(path, {"time": Signal(1), "q.a": Signal(4)}, KINDS)


def test_text_in_a_file_without_a_header_is_found_by_its_row(tmp_path):
    path = csv(tmp_path, "0.00,4.0\n0.01,oops\n0.02,4.0\n")
    with pytest.raises(InputError, match="row 2 holds the text 'oops'"):
        read_recording(path, {"time": Signal(1), "q.a": Signal(2)}, KINDS)
    path = csv(tmp_path, "0.00,4.0\n0.01,inf\n0.02,4.0\n")
    with pytest.raises(InputError, match="row 2 is infinite"):
        read_recording(path, {"time": Signal(1), "q.a": Signal(2)}, KINDS)


def test_columns_by_number_where_there_is_a_header(tmp_path):
    path = csv(tmp_path, "t,x,time,y\n0,1,5,2\n1,3,6,4\n")
    data = read_recording(path, {"time": Signal(1), "q.a": Signal(4)}, KINDS)
    np.testing.assert_array_equal(data["q.a"], [2, 4])


def test_lists_in_cells(tmp_path):
    rows = ['STATE,0,"[0.1, 0.2]","[1.0, nan]"', 'STATE,20000,"[0.3, 0.4]","[2.0, 3.0]"']
    path = csv(tmp_path, "\n".join(["type,timestamp,positions,currents", *rows, ""]))
    signals = {"time": Signal("timestamp", "us"), "q.a": Signal("positions[0]"), "tau.b": Signal("currents[1]", gain=2)}
    data = read_recording(path, signals, KINDS)
    np.testing.assert_allclose(data["time"], [0.0, 0.02])
    np.testing.assert_array_equal(data["q.a"], [0.1, 0.3])
    np.testing.assert_array_equal(data["tau.b"], [np.nan, 6.0])
    path = csv(tmp_path, 'time,q\n0,"[1, 2]"\n1,"[1, 2, 3]"\n')
    with pytest.raises(InputError, match=r"holds lists in its cells, of \[2, 3\] entries"):
        read_recording(path, {"q.a": Signal("q[0]")}, KINDS)


@pytest.mark.parametrize(("unit", "factor"), [("us", 1e-6), ("ms", 1e-3), ("ns", 1e-9), ("min", 60.0)])
def test_time_stamps_in_any_unit(tmp_path, unit, factor):
    path = csv(tmp_path, "stamp,q.a\n0,1\n10,2\n20,3\n")
    data = read_recording(path, {"time": Signal("stamp", unit)}, KINDS)
    np.testing.assert_allclose(data["time"], factor * np.array([0, 10, 20]))


def test_a_rate_where_there_is_no_clock(tmp_path):
    path = csv(tmp_path, "Joint_1,Joint_2\n1,2\n3,4\n5,6\n")
    data = read_recording(path, {"time": Signal("", rate=5000.0), "q.a": Signal("Joint_1")}, KINDS)
    np.testing.assert_allclose(data["time"], [0, 2e-4, 4e-4])


def test_mixes_of_what_does_not_fit_together(tmp_path):
    path = csv(tmp_path, "time,x [deg],y [rad]\n0,1,2\n1,3,4\n")
    with pytest.raises(InputError, match=r"'q.a' mixes columns of different units"):
        read_recording(path, {"q.a": Signal("", columns={"x": 1.0, "y": 1.0})}, KINDS)
    with pytest.raises(InputError, match=r"column 'z' of .signals. 'q.a' is not one of its 3 columns"):
        read_recording(path, {"q.a": Signal("", columns={"x": 1.0, "z": 1.0})}, KINDS)


URDF = """<robot name="swing"><link name="base"/><link name="rod"><inertial><origin xyz="0 0 -0.4"/><mass value="2"/>
<inertia ixx="0.05" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.01"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/></joint></robot>"""


def test_what_swings_freely_has_friction_without_any_torque(tmp_path):
    """A pendulum let go: its decay alone tells the friction. Integrated here, to 1e-10, not by the model that fits."""
    from scipy.integrate import solve_ivp

    inertia, weight, friction = 0.05 + 2 * 0.4**2, 2 * 9.81 * 0.4, 0.03
    t = np.arange(2000) / 100

    def rate(_, x):
        return [x[1], -(weight * np.sin(x[0]) + friction * x[1]) / inertia]

    swing = solve_ivp(rate, (0, 20), [1.2, 0.0], t_eval=t, rtol=1e-10, atol=1e-10)
    pd.DataFrame({"time": t, "angle": swing.y[0]}).to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "swing.urdf").write_text(URDF)
    (tmp_path / "swing.toml").write_text(
        'urdf = "swing.urdf"\neffects = ["viscous_friction"]\n[signals]\n"q.hinge" = "angle"\n"tau.hinge" = "none"\n'
    )
    assert (
        main(["identify", str(tmp_path / "swing.toml"), str(tmp_path / "run.csv"), "--json", str(tmp_path / "o")]) == 0
    )
    found = json.loads((tmp_path / "o").read_text())
    assert found["parameters"][0]["value"] == pytest.approx(friction, rel=1e-3)
    assert found["fit"]["tau.hinge"]["train"]["relative"] < 1e-3  # of the torque that weight and inertia have


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('"q.hinge" = "none"', "only a torque can be none"),
        ('"q.hinge" = { rate = 5 }', "allowed is, for time, a positive number of hertz"),
        ('"time" = { rate = 0 }', "allowed is, for time, a positive number of hertz"),
        ('"q.hinge" = { column = true }', "allowed is a name, or a number from 1"),
        ('"q.hinge" = { columns = {} }', "allowed is { name = weight, ... }"),
        ('"q.hinge" = { columns = { a = "b" } }', "allowed is { name = weight, ... }"),
        ('"q.hinge" = { column = "a", offset = "b" }', "allowed is a number, in the column's unit"),
        ('"q.hinge" = { column = "a", columns = { b = 1 } }', "allowed is { column = ..., unit = ..., gain = ... }"),
    ],
)
def test_mistakes_are_one_line(tmp_path, entry, words):
    (tmp_path / "swing.urdf").write_text(URDF)
    (tmp_path / "swing.toml").write_text(f'urdf = "swing.urdf"\n[signals]\n{entry}\n')
    refusal(lambda: load_model(tmp_path / "swing.toml"), tmp_path, words)


def test_every_form_is_written_as_it_is_read(tmp_path):
    (tmp_path / "swing.urdf").write_text(URDF)
    (tmp_path / "swing.toml").write_text(
        'urdf = "swing.urdf"\n[signals]\n"time" = { rate = 5000.0 }\n"tau.hinge" = "none"\n'
        '"q.hinge" = { columns = { "a b" = 2.0, c = -1.0 }, unit = "deg", offset = 3.0 }\n'
        '"q_link.hinge" = { column = 3 }\n'
    )
    model = load_model(tmp_path / "swing.toml")
    save_model(model, tmp_path / "again.toml", "written")
    assert load_model(tmp_path / "again.toml").signals == model.signals


def test_a_column_of_another_file_stands_beside_the_recordings_own(tmp_path):
    (tmp_path / "positions.csv").write_text("a,b\n1.0,2.0\n3.0,4.0\n")
    (tmp_path / "currents.csv").write_text("a,b [mA]\n10.0,20.0\n30.0,40.0\n")
    signals = {
        "time": Signal("", rate=10.0),
        "q.joint1": Signal("a"),
        "tau.joint1": Signal("b", unit="A", gain=2.0, file="currents.csv"),
        "tau.joint2": Signal("", gain=1.0, columns={"a": 1.0, "b": -1.0}, unit="A", file="units.csv"),
        "tau.joint3": Signal(1, gain=3.0, file="currents.csv"),
        "command.joint1": Signal("goals[1]", unit="deg", file="goals.csv"),
    }
    (tmp_path / "goals.csv").write_text('goals\n"[1.0, 180.0]"\n"[1.0, 90.0]"\n')
    (tmp_path / "units.csv").write_text("a,b\n5.0,1.0\n6.0,1.0\n")
    found = read_recording(tmp_path / "positions.csv", signals)
    np.testing.assert_allclose(found["q.joint1"], [1.0, 3.0])
    np.testing.assert_allclose(found["tau.joint1"], [0.04, 0.08])
    np.testing.assert_allclose(found["tau.joint2"], [4.0, 5.0])
    np.testing.assert_allclose(found["tau.joint3"], [30.0, 90.0])
    np.testing.assert_allclose(found["command.joint1"], [np.pi, np.pi / 2])
    assert found["tau.joint1"].attrs["column"] == "currents.csv/b [mA]"
    (tmp_path / "units.csv").write_text("a,b\n5.0,1.0\n")
    with pytest.raises(InputError, match=r"units\.csv: has 1 rows and positions\.csv 2;"):
        read_recording(tmp_path / "positions.csv", signals)
    (tmp_path / "units.csv").unlink()
    with pytest.raises(InputError, match="there is no such file"):
        read_recording(tmp_path / "positions.csv", signals)


def test_a_part_of_a_recording_is_read_by_its_time(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,q.joint1\n" + "".join(f"{k / 10},{k}\n" for k in range(20)))
    assert read_recording(f"{path}@0.5:0.8")["q.joint1"].values.tolist() == [5, 6, 7]
    assert read_recording(f"{path}@:0.2")["q.joint1"].values.tolist() == [0, 1]
    assert read_recording(f"{path}@1.8:")["q.joint1"].values.tolist() == [18, 19]
    assert read_recording(f"{path}@1.8:").attrs["path"] == f"{path}@1.8:"
    for part, said in (("@2:1", "is empty"), ("@5:9", "too little"), ("@x:9", "no such file")):
        with pytest.raises(InputError, match=said):
            read_recording(f"{path}{part}")
    odd = tmp_path / "odd.csv@0:1"
    odd.write_text(path.read_text())
    with pytest.raises(InputError, match="suffix"):  # a file of that very name is that file
        read_recording(odd)


def test_parts_of_one_file_may_be_fitted_and_held_out_where_they_do_not_overlap(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time\n0\n")
    demand_apart([f"{path}@0:4.5"], f"{path}@4.5:9")
    for fitted in (f"{path}@0:5", path, f"{path}@8:"):
        with pytest.raises(InputError, match="the holdout is also a recording to fit"):
            demand_apart([fitted], f"{path}@4.5:9")
