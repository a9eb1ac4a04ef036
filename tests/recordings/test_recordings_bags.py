"""ROS 2 bags written by rosbags, in both of ROS 2's storages."""

import shutil

import numpy as np
import pytest
from refusal import refusal
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from snarelab.recordings import Signal, read_recording

TYPES = get_typestore(Stores.ROS2_HUMBLE)
EPOCH = 1_700_000_000_000_000_000
MS = 1_000_000
BOTH = pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])


def header(stamp):
    time = TYPES.types["builtin_interfaces/msg/Time"](sec=stamp // 10**9, nanosec=stamp % 10**9)
    return TYPES.types["std_msgs/msg/Header"](stamp=time, frame_id="")


def joints(stamp, names, position=(), velocity=(), effort=()):
    return TYPES.types["sensor_msgs/msg/JointState"](
        header=header(stamp),
        name=list(names),
        position=np.array(position, dtype=float),
        velocity=np.array(velocity, dtype=float),
        effort=np.array(effort, dtype=float),
    )


def wrench(stamp, force):
    vector = TYPES.types["geometry_msgs/msg/Vector3"]
    message = TYPES.types["geometry_msgs/msg/Wrench"](
        force=vector(x=force, y=0.0, z=0.0), torque=vector(x=0.0, y=0.0, z=0.0)
    )
    return TYPES.types["geometry_msgs/msg/WrenchStamped"](header=header(stamp), wrench=message)


def number(value):
    return TYPES.types["std_msgs/msg/Float64"](data=value)


def write(path, storage, messages):
    """Write (topic, bag stamp, message) triples."""
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections = {}
        for topic, stamp, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], stamp, TYPES.serialize_cdr(message, kind))
    return path


def arm(count=10, period=10 * MS, late=3 * MS):
    """Joint states at header stamps that are ``late`` before the bag's."""
    stamps = [EPOCH + k * period for k in range(count)]
    return [
        ("/joint_states", s + late, joints(s, ["b", "a"], [10.0 + k, k], [0.5, 0.25], [-1.0, k / 2]))
        for k, s in enumerate(stamps)
    ]


@BOTH
def test_joint_states_need_no_mapping(tmp_path, storage):
    data = read_recording(write(tmp_path / "bag", storage, arm()), joint_kinds={"b": "prismatic"})
    assert set(data.data_vars) == {"q.a", "q.b", "qd.a", "qd.b", "tau.a", "tau.b"}
    np.testing.assert_allclose(data["time"] - 1.7e9, 0.01 * np.arange(10), atol=5e-7)
    np.testing.assert_array_equal(data["q.a"], np.arange(10.0))
    np.testing.assert_array_equal(data["q.b"], 10.0 + np.arange(10.0))
    np.testing.assert_array_equal(data["tau.a"], 0.5 * np.arange(10.0))
    assert (data["qd.a"] == 0.25).all()
    assert [data[name].attrs["unit"] for name in ("q.a", "q.b", "tau.b")] == ["rad", "m", "N"]
    assert "clock of /joint_states" in data.attrs["notes"][0]


@BOTH
def test_a_single_file_is_enough(tmp_path, storage):
    bag = write(tmp_path / "bag", storage, arm())
    (file,) = (file for file in bag.iterdir() if file.suffix in (".db3", ".mcap"))
    alone = tmp_path / file.name
    shutil.copy(file, alone)
    assert read_recording(alone).sizes["time"] == 10


@BOTH
def test_topics_of_other_rates_are_matched_not_interpolated(tmp_path, storage):
    slow = [("/wrench", EPOCH + s * MS, wrench(EPOCH + s * MS, float(s))) for s in (2, 26, 50)]
    fast = [("/temperature", EPOCH + s * MS, number(float(s))) for s in range(-5, 95)]
    bag = write(tmp_path / "bag", storage, sorted([*arm(), *slow, *fast], key=lambda triple: triple[1]))
    signals = {
        "force.tip.x": Signal("/wrench/wrench.force.x", unit="mN"),
        "temp.a": Signal("/temperature/data", unit="degC"),
    }
    data = read_recording(bag, signals)
    nan = np.nan
    np.testing.assert_allclose(
        data["force.tip.x"], [0.002, nan, nan, 0.026, nan, 0.05, nan, nan, nan, nan], rtol=1e-14
    )  # stamps 2, 26 and 50 ms; clock 0, 10, ..., 90 ms; half a period is 5 ms
    np.testing.assert_array_equal(data["temp.a"], 10.0 * np.arange(10))
    notes = " | ".join(data.attrs["notes"])
    assert "/wrench: 10 samples of the clock found 3 of its 3 messages" in notes
    assert "at most 4 ms" in notes
    assert "/temperature: messages carry no header stamp" in notes
    assert "force.tip.x: 7 of 10 samples are missing" in notes


@BOTH
def test_exactly_half_a_period_is_no_match(tmp_path, storage):
    between = [("/x", EPOCH + s * MS, number(1.0)) for s in (15, 31)]
    data = read_recording(write(tmp_path / "bag", storage, [*arm(), *between]), {"tension.s": Signal("/x/data")})
    assert np.flatnonzero(~np.isnan(data["tension.s"].values)).tolist() == [3]


def test_mapping_raw_fields_of_a_joint_state(tmp_path):
    bag = write(tmp_path / "bag", StoragePlugin.MCAP, arm())
    signals = {
        "time": Signal("/joint_states/header.stamp", unit="s"),
        "tau.a": Signal("/joint_states/effort[1]", unit="A", gain=4.0),
        "tau.b": Signal("tau.b", gain=-2.0),
    }
    data = read_recording(bag, signals)
    np.testing.assert_array_equal(data["tau.a"], 2.0 * np.arange(10.0))
    assert (data["tau.b"] == 2.0).all()
    np.testing.assert_allclose(data["time"] - 1.7e9, 0.01 * np.arange(10), atol=5e-7)


def test_without_joint_states_the_torque_gives_the_clock(tmp_path):
    slow = [("/position", EPOCH + 20 * k * MS, number(float(k))) for k in range(5)]
    fast = [("/torque", EPOCH + 10 * k * MS, number(float(k))) for k in range(10)]
    bag = write(tmp_path / "bag", StoragePlugin.MCAP, sorted([*slow, *fast], key=lambda triple: triple[1]))
    data = read_recording(bag, {"q.a": Signal("/position/data"), "tau.a": Signal("/torque/data")})
    np.testing.assert_array_equal(data["tau.a"], np.arange(10.0))
    np.testing.assert_array_equal(data["q.a"][::2], np.arange(5.0))
    assert np.isnan(data["q.a"][1::2]).all()


def test_two_publishers_on_one_topic(tmp_path):
    gripper = [
        ("/joint_states", EPOCH + k * 10 * MS + MS, joints(0 + EPOCH + k * 10 * MS + MS, ["g"], [7.0]))
        for k in range(10)
    ]
    data = read_recording(write(tmp_path / "bag", StoragePlugin.SQLITE3, [*arm(late=0), *gripper]))
    assert data.sizes["time"] == 10
    assert (data["q.g"] == 7.0).all()
    np.testing.assert_array_equal(data["q.a"], np.arange(10.0))


def test_joint_states_without_stamps_use_the_bag(tmp_path):
    messages = [("/joint_states", EPOCH + k * 10 * MS, joints(0, ["a"], [float(k)], effort=[np.nan])) for k in range(5)]
    data = read_recording(write(tmp_path / "bag", StoragePlugin.MCAP, messages))
    np.testing.assert_allclose(data["time"] - 1.7e9, 0.01 * np.arange(5), atol=5e-7)
    notes = " | ".join(data.attrs["notes"])
    assert "no header stamp" in notes
    assert "tau.a of /joint_states is ignored" in notes
    assert set(data.data_vars) == {"q.a"}


def refused(path, *words, signals=None):
    refusal(lambda: read_recording(path, signals), path, *words)


@pytest.mark.parametrize(
    ("column", "words"),
    [
        ("/wrnch/wrench.force.x", ("'/wrnch/wrench.force.x'", "2 topics", "'/wrench'")),
        ("/wrench/wrench.forse.x", ("no field 'forse'", "'force'")),
        ("/wrench/wrench.force", ("not one number",)),
        ("wrench.force.x", ("is not one of its",)),
    ],
)
def test_mapped_fields_that_are_not_there(tmp_path, column, words):
    bag = write(tmp_path / "bag", StoragePlugin.MCAP, [*arm(), ("/wrench", EPOCH, wrench(EPOCH, 1.0))])
    refused(bag, *words, signals={"force.tip.x": Signal(column)})


def test_topic_that_never_meets_the_clock(tmp_path):
    bag = write(tmp_path / "bag", StoragePlugin.MCAP, [*arm(), ("/x", EPOCH + 10**12, number(1.0))])
    refused(bag, "no message of /x is within half a period", signals={"tension.s": Signal("/x/data")})


def test_bag_without_joint_states(tmp_path):
    refused(
        write(tmp_path / "bag", StoragePlugin.MCAP, [("/x", EPOCH, number(1.0))]), "no sensor_msgs/JointState", "/x"
    )


def test_joint_state_that_does_not_fit_itself(tmp_path):
    messages = [("/joint_states", EPOCH, joints(EPOCH, ["a", "b"], [1.0]))]
    refused(write(tmp_path / "bag", StoragePlugin.MCAP, messages), "names 2 joints and gives 1 of position")


def test_stamps_that_go_backwards(tmp_path):
    messages = [
        ("/joint_states", EPOCH + k, joints(EPOCH + s * MS, ["a"], [1.0])) for k, s in enumerate((0, 10, 20, 15))
    ]
    refused(write(tmp_path / "bag", StoragePlugin.MCAP, messages), "goes backwards in row 4")


@BOTH
def test_damaged_bag(tmp_path, storage):
    bag = write(tmp_path / "bag", storage, arm(500))
    (file,) = (file for file in bag.iterdir() if file.suffix in (".db3", ".mcap"))
    file.write_bytes(file.read_bytes()[:5000])
    refused(bag, "cannot be read as a ROS 2 bag")
    file.write_bytes(b"not a bag at all")
    refused(file, "cannot be read as a ROS 2 bag")


def test_folder_without_metadata(tmp_path):
    refused(tmp_path, "cannot be read as a ROS 2 bag", "metadata.yaml")
