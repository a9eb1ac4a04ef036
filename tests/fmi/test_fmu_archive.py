"""Archives from anywhere: what could harm or cannot run is refused, all problems in one line, before any code runs."""

import re
import struct
import warnings
import zipfile
import zlib

import pytest
from refusal import refusal

from bench.fmu_models import Slave, rewritten
from snarelab.errors import InputError
from snarelab.fmi.archive import open_fmu
from snarelab.fmi.binaries import binary_folder
from snarelab.fmu.export import export


@pytest.fixture(scope="module", params=[2, 3])
def good(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "target.fmu"
    export("suspended_target", request.param, path)
    return path, request.param


def refused(path, folder):
    """The one line, and nothing written outside or inside."""
    before = sorted(p for p in folder.parent.rglob("*"))
    text = refusal(lambda: open_fmu(path, folder), path, leads=False)
    assert sorted(p for p in folder.parent.rglob("*") if folder not in [p, *p.parents]) == before
    return text


def test_a_sound_one_is_unpacked_and_described(good, tmp_path):
    path, version = good
    found = open_fmu(path, tmp_path / "x")
    assert found.version == version
    assert found.binary.is_file()
    assert found.description.coSimulation.modelIdentifier == "suspended_target"


@pytest.mark.parametrize("name", ["../outside.txt", "/etc/outside", "a/../../outside", "C:/outside", "..\\outside"])
def test_entries_that_lead_outside(good, tmp_path, name):
    path = rewritten(good[0], tmp_path / "bad.fmu", lambda n, d: d)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "x")
    assert "leads outside" in refused(path, tmp_path / "x")
    assert not (tmp_path / "outside.txt").exists()
    assert not (tmp_path / "x").exists()


def test_links_and_twins_and_bombs_are_all_listed(good, tmp_path):
    path = rewritten(good[0], tmp_path / "bad.fmu", lambda n, d: d)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        link = zipfile.ZipInfo("resources/link")
        link.external_attr = 0o120777 << 16
        archive.writestr(link, "/etc/passwd")
        archive.writestr("resources/zeros", bytes(64 << 20))
        with pytest.warns(UserWarning, match="Duplicate name"):
            archive.writestr("modelDescription.xml", "<x/>")
    text = refused(path, tmp_path / "x")
    for word in ("3 problems", "is a link", "-fold when unpacked", "there twice"):
        assert word in text


def test_a_size_that_is_a_lie(good, tmp_path):
    """A central directory that declares 10 bytes for what unpacks to a million."""
    path = tmp_path / "bad.fmu"
    with zipfile.ZipFile(good[0]) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            new.writestr(entry.filename, old.read(entry))
        new.writestr("resources/big", b"abc" * 400_000)
    data = bytearray(path.read_bytes())
    at = data.rindex(b"PK\x01\x02", 0, data.rindex(b"resources/big"))
    struct.pack_into("<II", data, at + 16, zlib.crc32(b"abc" * 3 + b"a"), struct.unpack_from("<I", data, at + 20)[0])
    struct.pack_into("<I", data, at + 24, 10)
    path.write_bytes(data)
    open_or_refuse = tmp_path / "x"
    try:
        open_fmu(path, open_or_refuse)
    except InputError:
        return
    assert (open_or_refuse / "resources" / "big").stat().st_size == 10


def patched(source, target, entry, offset, layout, value):
    """A copy with other bytes in the central directory's record of an entry."""
    data = bytearray(source.read_bytes())
    at = data.rindex(b"PK\x01\x02", 0, data.rindex(entry.encode()))
    struct.pack_into(layout, data, at + offset, value)
    target.write_bytes(data)
    return target


def test_encrypted_entries_and_backslashes_are_listed(good, tmp_path):
    path = rewritten(good[0], tmp_path / "plain.fmu", lambda n, d: d)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources\\table.csv", "1")
        archive.writestr("resources/secret", "x")
    text = refused(patched(path, tmp_path / "bad.fmu", "resources/secret", 8, "<H", 1), tmp_path / "x")
    assert "2 problems" in text
    assert "table.csv' has a backslash, where FMI wants a slash" in text
    assert "entry 'resources/secret' is encrypted" in text


def test_declared_sizes_have_limits(good, tmp_path):
    """An entry of 3.9 GiB, packed to as much by its own account, beside another; a description of 65 MiB."""
    path = rewritten(good[0], tmp_path / "plain.fmu", lambda n, d: d)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/a", "x")
        archive.writestr("resources/b", "x")
    for name in ("resources/a", "resources/b"):
        for offset in (20, 24):
            patched(path, path, name, offset, "<I", 0xFA000000)
    assert "7.8 GiB when unpacked, more than 4 GiB" in refused(path, tmp_path / "x")
    path = rewritten(good[0], tmp_path / "long.fmu", lambda n, d: d)
    for offset, size in ((20, 1 << 20), (24, 65 << 20)):
        patched(path, path, "modelDescription.xml", offset, "<I", size)
    assert "modelDescription.xml has 65 MiB, more than 64" in refused(path, tmp_path / "x")


def test_entries_are_counted(tmp_path):
    path = tmp_path / "many.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for n in range(20_001):
            archive.writestr(f"{n}", "")
    assert refused(path, tmp_path / "x").endswith("20001 entries, more than 20000")


def test_an_entity_bomb(good, tmp_path):
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>'

    def change(name, data):
        text = data.decode() if name == "modelDescription.xml" else ""
        return text.replace("<fmiModelDescription", f"{bomb}<fmiModelDescription", 1).encode() if text else data

    path = rewritten(good[0], tmp_path / "bad.fmu", change)
    assert "document type" in refused(path, tmp_path / "x")


def test_what_the_model_keeps_for_itself_is_its_own(good, tmp_path):
    """XML with a document type, a table of zeros, and entries that are there twice."""
    path = rewritten(good[0], tmp_path / "sound.fmu", lambda n, d: d)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/settings.xml", '<!DOCTYPE settings SYSTEM "settings.dtd"><settings/>')
        archive.writestr("documentation/page.xml", "no XML at all")
        archive.writestr("resources/table.bin", bytes(20 << 20))
        for text in ("old", "new"):
            with warnings.catch_warnings(action="ignore"):
                archive.writestr("resources/note.txt", text)
                archive.writestr("modelDescription.xml", archive.read("modelDescription.xml"))
    open_fmu(path, tmp_path / "x")
    assert (tmp_path / "x" / "resources" / "note.txt").read_text() == "new"  # the last one, as in any ZIP archive
    assert (tmp_path / "x" / "resources" / "table.bin").stat().st_size == 20 << 20


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda n, d: None if n == "modelDescription.xml" else d, ["no modelDescription.xml"]),
        (lambda n, d: d[:200] if n == "modelDescription.xml" else d, ["is not XML"]),
        (
            lambda n, d: d.replace(b"CoSimulation", b"ModelExchange") if n == "modelDescription.xml" else d,
            ["no co-simulation"],
        ),
        (
            lambda n, d: re.sub(rb'fmiVersion="\d', b'fmiVersion="1', d) if n == "modelDescription.xml" else d,
            ["modelDescription.xml cannot be read"],
        ),
        (
            lambda n, d: (
                d.replace(b'modelIdentifier="', b'modelIdentifier="../../') if n == "modelDescription.xml" else d
            ),
            ["modelIdentifier '../../suspended_target' is no C identifier"],
        ),
        (
            lambda n, d: d.replace(b'name="stiffness"', b'name="damping"') if n == "modelDescription.xml" else d,
            ["variable 'damping' is described twice"],
        ),
        (lambda n, d: None if n.startswith("binaries") else d, ["no binary", "for this platform", "fmpy compile"]),
        (lambda n, d: d[:5000] if n.startswith("binaries") else d, ["broken ELF file"]),
        (lambda n, d: b"MZ" + d if n.startswith("binaries") else d, ["is no shared library"]),
        (
            lambda n, d: (
                d.replace(b"FMUstate\0", b"FMUxxxxx\0").replace(b"FMUState\0", b"FMUxxxxx\0")
                if n.startswith("binaries")
                else d
            ),
            ["the binary lacks", "FMU", "which the model description promises"],
        ),
    ],
)
def test_descriptions_and_binaries_that_do_not_fit(good, tmp_path, change, words):
    path = rewritten(good[0], tmp_path / "bad.fmu", change)
    refusal(lambda: open_fmu(path, tmp_path / "x"), path, *words, leads=False)


def test_another_machines_binary(good, tmp_path):
    def change(name, data):
        return data[:18] + struct.pack("<H", 0x2A) + data[20:] if name.startswith("binaries") else data

    path = rewritten(good[0], tmp_path / "bad.fmu", change)
    with pytest.raises(InputError, match="another machine"):
        open_fmu(path, tmp_path / "x")


def test_a_description_of_another_build_is_caught_at_instantiation(good, tmp_path):
    def change(name, data):
        return re.sub(rb'="\{[0-9a-f]{8}', b'="{00000000', data) if name == "modelDescription.xml" else data

    path, logged = rewritten(good[0], tmp_path / "bad.fmu", change), []
    if good[1] == 3:
        with pytest.raises(Exception, match=r"(?i)instantiate"):
            Slave(path, tmp_path / "x")
        return
    with pytest.raises(Exception, match="Failed to instantiate"):
        Slave(path, tmp_path / "x", logged=logged)
    assert any("are not of one export" in line for line in logged)


@pytest.mark.parametrize("content", [b"", b"PK", b"no archive at all" * 100])
def test_no_archive(tmp_path, content):
    (tmp_path / "bad.fmu").write_bytes(content)
    assert "no sound ZIP archive" in refused(tmp_path / "bad.fmu", tmp_path / "x")


def test_nothing_there(tmp_path):
    assert "is not there" in refused(tmp_path / "none.fmu", tmp_path / "x")


def test_a_binary_folder_has_fmis_name():
    assert binary_folder(2) in ("linux64", "win64", "darwin64", "linux32")
    assert re.fullmatch(r"\w+-(linux|windows|darwin)", binary_folder(3))
