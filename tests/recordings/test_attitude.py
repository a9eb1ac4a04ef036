"""A recorded attitude: what is missing, what is not a quaternion, in recordings of a floating base and of a capture."""

import numpy as np
import pytest
import xarray as xr

from bench.drake_servicer import model as servicer
from snarelab.errors import InputError
from snarelab.identification.fitting.floating_terms import with_twist
from snarelab.identification.snare.recording import load_captures
from snarelab.models.model_file import load_model
from snarelab.recordings import read_recording, write_recording
from snarelab.recordings.attitude import attitude

QUARTER = np.array([np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)])  # about z: x of the base points along y of the world
ROWS, GAP, LONG = 300, slice(100, 104), 150


def recorded(path, body, turn=QUARTER, **changed):
    """A body that moves along y of the world and has turned by a quarter about z."""
    columns = {f"pos.{body}.{a}": np.zeros(ROWS) for a in "xyz"} | {f"vel.{body}.{a}": np.zeros(ROWS) for a in "xyz"}
    columns[f"vel.{body}.y"] = np.full(ROWS, 0.25)
    columns |= {f"omega.{body}.{a}": np.zeros(ROWS) for a in "xyz"}
    columns |= {f"quat.{body}.{a}": np.full(ROWS, turn[i]) for i, a in enumerate("wxyz")}
    columns |= {f"{kind}.{j}": np.zeros(ROWS) for kind in ("q", "tau") for j in ("shoulder", "elbow")}
    for name, (rows, value) in changed.items():
        columns[f"quat.{body}.{name}"][rows] = value
    data = xr.Dataset({k: ("time", x) for k, x in columns.items()}, coords={"time": 0.02 * np.arange(ROWS)})
    write_recording(data, path)
    return path


@pytest.fixture
def base(tmp_path):
    return servicer(tmp_path).tree


def test_a_gap_in_one_component_is_a_gap_of_the_twist_there_and_nowhere_else(tmp_path, base):
    path = recorded(tmp_path / "run.csv", base.body, x=(GAP, np.nan))
    found = with_twist(read_recording(path), base)
    twist = np.stack([found[f"q.{joint.name}"].values for joint in base.joints[:6]], 1)
    here = np.zeros(ROWS, bool)
    here[GAP] = True
    assert np.isnan(twist[here]).all()
    np.testing.assert_allclose(twist[~here], np.tile([0.25, 0, 0, 0, 0, 0], (ROWS - 4, 1)), atol=1e-12)


def test_what_is_no_unit_quaternion_is_refused_with_its_time(tmp_path, base):
    wanted = r"at t = 3 s has length 1\.58; give unit quaternions, w first"
    path = recorded(tmp_path / "run.csv", base.body, w=(LONG, np.sqrt(2)), x=(GAP, np.nan))
    with pytest.raises(InputError, match=wanted):
        with_twist(read_recording(path), base)
    (tmp_path / "model.toml").write_text('name = "capture"\nsystem = "snare_capture"\n')
    path = recorded(tmp_path / "capture.csv", "target", w=(LONG, np.sqrt(2)))
    with pytest.raises(InputError, match="quat.target " + wanted):
        load_captures(load_model(tmp_path / "model.toml"), [path])


def test_rounding_is_allowed(tmp_path):
    data = read_recording(recorded(tmp_path / "run.csv", "hub", turn=np.round(QUARTER, 2)))
    np.testing.assert_allclose(attitude(data, "hub", "run.csv")[7], np.round(QUARTER, 2))
