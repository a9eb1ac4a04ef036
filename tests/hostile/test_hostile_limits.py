"""Small files that stand for gigabytes, loops without end and places elsewhere are refused before any harm is done."""

import os
import shutil
import struct
import tempfile
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from fuzz.readers import CORPUS, attempt
from refusal import refusal

from snarelab import files
from snarelab.cosim.setup import Hosting, load_setup
from snarelab.errors import InputError
from snarelab.models.model_file import load_model
from snarelab.models.urdf import load_urdf
from snarelab.recordings import Signal, columns, csv_table, hdf5, matlab, matlab_structure, read_recording

MIB = 1 << 20


@pytest.fixture
def small(monkeypatch):
    """The caps, a thousand times smaller: tests must not need what they forbid."""
    for module in (columns, csv_table, matlab, matlab_structure):
        monkeypatch.setattr(module, "LARGEST", 4 * MIB)


def refused(read, path, *words):
    refusal(lambda: read(path), path, *words, leads=False)


def test_parquet_that_unpacks_to_more(small, tmp_path):
    path = tmp_path / "run.parquet"
    zeros = np.zeros(MIB)
    pq.write_table(pa.table({"time": np.arange(MIB), "q.j": zeros}), path, compression="zstd")
    refused(read_recording, path, "unpacks to")


def test_hdf5_dataset_that_was_never_written(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(4.0)
        file.create_dataset("q.j", shape=(1 << 40,), chunks=(1024,), dtype="f8")
    assert path.stat().st_size < 10_000
    refused(read_recording, path, "8192.0 GiB", "4 are read")


def test_hdf5_data_in_other_files_is_not_read(tmp_path):
    other, path = tmp_path / "other.h5", tmp_path / "run.h5"
    with h5py.File(other, "w") as file:
        file["q"] = np.arange(4.0)
    (tmp_path / "raw").write_bytes(np.arange(4.0).tobytes())
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "q", (4,))
    with h5py.File(path, "w") as file:
        file["time"] = file["q.j"] = np.arange(4.0)
        file["q.link"] = h5py.ExternalLink(str(other), "q")
        file.create_dataset("q.raw", shape=(4,), dtype="f8", external=[(str(tmp_path / "raw"), 0, 32)])
        file.create_virtual_dataset("q.virtual", layout)
    signals = {"q.a": Signal("q.link"), "q.b": Signal("q.raw"), "q.c": Signal("q.virtual")}
    for name, signal in signals.items():
        with pytest.raises(InputError, match=str(signal.column)):
            read_recording(path, {name: signal})


def compressed(content):
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    packed = zlib.compress(content)
    return head + struct.pack("<II", 15, len(packed)) + packed


def test_matlab_bomb(small, tmp_path):
    path = tmp_path / "run.mat"
    path.write_bytes(compressed(struct.pack("<II", 14, 64 * MIB) + bytes(64 * MIB)))
    assert path.stat().st_size < MIB
    refused(read_recording, path, "unpacks to")


def test_damage_inside_a_compressed_matlab_variable(tmp_path):
    """The checksum is right and the content is not: SciPy alone would crash the interpreter."""
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"q": {"j": np.arange(200.0)}})
    data = path.read_bytes()[128:]
    field = data.index(b"\x0e\x00\x00\x00", 4)
    path.write_bytes(compressed(data[: field + 8] + b"\xff" + data[field + 9 :]))
    refused(read_recording, path, "cannot be read as a MATLAB file")


@pytest.mark.parametrize("value", [np.arange(4.0), 5.0, "text", np.array(["time", "x"], dtype=object)])
def test_matlab_struct_with_a_field_that_scipy_keeps_for_itself(tmp_path, value):
    path = tmp_path / "run.mat"
    scipy.io.savemat(path, {"time": np.arange(4.0), "q": {"xfieldnames": value, "joint1": np.arange(4.0)}})
    path.write_bytes(path.read_bytes().replace(b"xfieldnames", b"_fieldnames"))
    assert list(read_recording(path)) == ["q.joint1"]


def test_mcap_chunk_that_unpacks_without_end(tmp_path, monkeypatch):
    zstd = pytest.importorskip("backports.zstd")
    monkeypatch.setattr(files, "LARGEST_MEMORY", 256 * MIB)
    path = tmp_path / "run.mcap"
    path.write_bytes(bag_of(zstd.compress(bytes(1 << 30))))
    before = peak()
    refused(read_recording, path, "GiB to be read")
    assert peak() - before < 400 * MIB


def bag_of(chunk):
    """An MCAP file with one zstd chunk."""

    def record(kind, content):
        return bytes([kind]) + struct.pack("<Q", len(content)) + content

    def text(content):
        return struct.pack("<I", len(content)) + content

    name, number = b"sensor_msgs/msg/JointState", struct.pack("<H", 1)
    schema = record(3, number + text(name) + text(b"ros2msg") + text(b"float64[] position"))
    channel = record(4, number + number + text(b"/joint_states") + text(b"cdr") + struct.pack("<I", 0))
    head = b"\x89MCAP0\r\n" + record(1, text(b"ros2") + text(b""))
    times = struct.pack("<QQ", 0, 1)
    body = record(6, times + struct.pack("<QI", 1 << 30, 0) + text(b"zstd") + struct.pack("<Q", len(chunk)) + chunk)
    where = struct.pack("<QQ", len(head), len(body))
    counts = struct.pack("<IHQ", 10, 1, 1)
    offsets, sizes = struct.pack("<IHQQ", 10, 1, len(head), 0), struct.pack("<QQ", len(chunk), 1 << 30)
    index = record(8, times + where + offsets + text(b"zstd") + sizes)
    statistics = record(11, struct.pack("<QHIIII", 1, 1, 1, 0, 0, 1) + times + counts)
    summary = len(head) + len(body)
    footer = record(2, struct.pack("<QQI", summary, 0, 0))
    return head + body + schema + channel + index + statistics + footer + b"\x89MCAP0\r\n"


def peak():
    """Most memory this process ever had resident [bytes]."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def test_bag_whose_messages_hold_arrays_without_end(tmp_path):
    good = (CORPUS / "mcap" / "plain").read_bytes()
    old, new = b"float64[] position", b"string[99999999] x"
    line = attempt("mcap", good.replace(old, new), tmp_path)
    assert "99999999 of x; 1000000 is the most" in line


@pytest.mark.parametrize("name", ["run.csv", "run.mcap", "model.toml", "arm.urdf", "system.toml"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    read = {"model.toml": load_model, "arm.urdf": load_urdf, "system.toml": load_setup}.get(name, read_recording)
    refused(read, tmp_path / name)


@pytest.mark.parametrize("name", ["model.toml", "arm.urdf", "system.toml"])
def test_text_of_gigabytes(tmp_path, name):
    with (tmp_path / name).open("wb") as file:
        file.truncate(1 << 40)  # no block of it is on the disk
    read = {"model.toml": load_model, "arm.urdf": load_urdf, "system.toml": load_setup}[name]
    refused(read, tmp_path / name, "1099511627776 bytes")


def test_urdf_that_leads_to_a_device(tmp_path):
    (tmp_path / "model.toml").write_text('urdf = "/dev/zero"\n')
    with pytest.raises(InputError, match="/dev/zero: cannot be read: it is not a regular file"):
        load_model(tmp_path / "model.toml")


@pytest.mark.parametrize(
    ("entry", "link"),
    [("../outside.fmu", False), ("/tmp/outside.fmu", False), ("resources/..", False), ("a.fmu", True)],
)
def test_ssp_whose_component_lies_elsewhere(tmp_path, entry, link):
    description = (CORPUS / "ssp_description" / "nested").read_text().replace("resources/target.fmu", entry)
    inside = tmp_path / "inside"
    inside.mkdir()
    with zipfile.ZipFile(inside / "system.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", description)
        info = zipfile.ZipInfo(entry)
        info.external_attr = (0o120777 if link else 0o100644) << 16
        archive.writestr(info, "/etc/passwd" if link else (CORPUS / "fmu" / "target").read_bytes())
    before = set(Path(tempfile.gettempdir()).iterdir())
    with suppress(InputError):  # names that lead elsewhere are names inside the archive, and no more
        load_setup(inside / "system.ssp", Hosting(own_process=False))
    assert list(tmp_path.iterdir()) == [inside]
    assert not [p for p in set(Path(tempfile.gettempdir()).iterdir()) - before if "outside" in p.name]


def test_ssp_of_systems_without_end(tmp_path):
    text = (CORPUS / "ssp_description" / "nested").read_text()
    level = '<ssd:System name="s"><ssd:Elements>'
    start, end = text.index("<ssd:Elements>") + len("<ssd:Elements>"), text.rindex("</ssd:Elements>")
    deep = text[:start] + 5000 * level + 5000 * "</ssd:Elements></ssd:System>" + text[end:]
    assert "deep in one another" in attempt("ssp_description", deep.encode(), tmp_path)


def test_urdf_of_thousands_of_links(tmp_path):
    links = "".join(f'<link name="l{k}"/>' for k in range(60_000))
    assert "has more than 1000 links" in attempt("urdf", f'<robot name="r">{links}</robot>'.encode(), tmp_path)


@pytest.mark.parametrize("text", ["effects = [{}]", "[parameters]\n{}"])
def test_model_of_entries_without_end(tmp_path, text):
    many = '"viscous_friction",' * 20_000 if "[{}]" in text else "".join(f"k{k} = 1\n" for k in range(20_000))
    line = attempt("model", f'urdf = "arm.urdf"\n{text.format(many)}'.encode(), tmp_path)
    assert "20000 entries; 10000 is the most" in line


def test_columns_without_end(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time" + "".join(f",q.j{k}" for k in range(100_000)) + "\n0\n1\n")
    refused(read_recording, path, "100001 columns", "10000 are read")


def test_hdf5_file_that_is_never_read_to_its_end(tmp_path, monkeypatch):
    """Found by fuzzing: an attribute from whose reading the HDF5 library does not return."""
    monkeypatch.setattr(hdf5, "PATIENCE", 3.0)
    shutil.copy(CORPUS / "without_end" / "hdf5_attribute", tmp_path / "run.h5")
    refused(read_recording, tmp_path / "run.h5", "cannot be read as HDF5")


def test_hdf5_groups_without_end(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w", libver="latest") as file:
        file["time"] = np.arange(4.0)
        file["loop"] = file["/"]
        group = file.id
        for _ in range(2000):
            group = h5py.h5g.create(group, b"g")
    refused(read_recording, path, "32 deep")
