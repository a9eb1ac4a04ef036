"""Every reader of what users hand in, as a function of bytes: it reads them, or raises InputError with one line."""

import importlib
import io
import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from snarelab.cosim import setup, toml_system
from snarelab.cosim.participants.fmu import Fmu
from snarelab.errors import InputError
from snarelab.models.model_file import load_model
from snarelab.recordings import Signal, read_recording
from snarelab.recordings.columns import split_header
from snarelab.recordings.units import parse_unit
from snarelab.tolerance import capture
from snarelab.tolerance.results import Results
from snarelab.tolerance.study import Study, load_study

_SIGNALS = {"time": Signal("t[0]", "ms"), "tau.joint1": Signal("/wrench/wrench.force.x", gain="gtau")}
CORPUS = Path(__file__).parent / "corpus"


def _recording(suffix: str, pack: Callable[[bytes], bytes] = bytes) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        path = folder / f"run{suffix}"
        path.write_bytes(pack(data))
        try:
            read_recording(path, _SIGNALS)
        except InputError as error:
            one_line(error)
        read_recording(path)

    return read


def _compressed(data: bytes) -> bytes:
    """A MATLAB 5 file with one compressed variable."""
    inside = zlib.compress(data)
    head = b"MATLAB 5.0 MAT-file".ljust(124, b" ") + b"\x00\x01IM"
    return head + (15).to_bytes(4, "little") + len(inside).to_bytes(4, "little") + inside


def _bag_folder(data: bytes, folder: Path) -> None:
    (folder / "run.mcap").write_bytes((CORPUS / "mcap" / "plain").read_bytes())
    (folder / "metadata.yaml").write_bytes(data)
    read_recording(folder)


def _model(data: bytes, folder: Path) -> None:
    (folder / "arm.urdf").write_bytes((CORPUS / "urdf" / "two_joints").read_bytes())
    (folder / "model.toml").write_bytes(data)
    load_model(folder / "model.toml")


def _urdf(data: bytes, folder: Path) -> None:
    (folder / "arm.urdf").write_bytes(data)
    (folder / "model.toml").write_text('urdf = "arm.urdf"\n')
    load_model(folder / "model.toml")


def _archive(suffix: str, entry: str, others: Mapping[str, str]) -> Callable[[bytes, Path], None]:
    """An archive of which one entry is given, and the others are files of the corpus."""

    def pack(data: bytes) -> bytes:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr(entry, data)
            for name, source in others.items():
                archive.writestr(name, (CORPUS / source).read_bytes())
        return buffer.getvalue()

    return lambda data, folder: _FILES[suffix](pack(data), folder)


def _system(suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        path = folder / f"system{suffix}"
        path.write_bytes(data)
        built = setup.load_setup(path, setup.Hosting(own_process=False))
        for participant in built.system.participants.values():
            participant.close()

    return read


def _fmu(data: bytes, folder: Path) -> None:
    (folder / "model.fmu").write_bytes(data)
    Fmu(folder / "model.fmu").close()


def _study(data: bytes, folder: Path) -> None:
    (folder / "study.toml").write_bytes(data)
    load_study(folder / "study.toml")


@cache
def _study_of_results() -> Study:
    study = load_study(CORPUS / "study" / "ground")
    return replace(study, capture=replace(study.capture, version="1"))  # else the sources' digest


def _results(name: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        study = _study_of_results()
        (folder / "cases").mkdir()
        (folder / "study.json").write_text(json.dumps(study.identity()))
        (folder / name).write_bytes(data)
        Results(folder, study).table()

    return read


def _unit(data: bytes, folder: Path) -> None:
    parse_unit(split_header(data.decode(errors="replace"))[1] or data.decode(errors="replace"), "c", folder)


_FILES = {".ssp": _system(".ssp"), ".fmu": _fmu}

READERS: Mapping[str, Callable[[bytes, Path], None]] = {
    "csv": _recording(".csv"),
    "parquet": _recording(".parquet"),
    "matlab": _recording(".mat"),
    "matlab_compressed": _recording(".mat", _compressed),
    "hdf5": _recording(".h5"),
    "mcap": _recording(".mcap"),
    "db3": _recording(".db3"),
    "bag_folder": _bag_folder,
    "unit": _unit,
    "model": _model,
    "urdf": _urdf,
    "system": _system(".toml"),
    "ssp": _system(".ssp"),
    "ssp_description": _archive(".ssp", "SystemStructure.ssd", {"resources/target.fmu": "fmu/target"}),
    "fmu": _fmu,
    "fmu_description": _archive(
        ".fmu",
        "modelDescription.xml",
        {f"binaries/{place}/target.so": "library/target.so" for place in ("linux64", "x86_64-linux")},
    ),
    "study": _study,
    "results": _results("cases/space-0000001.parquet"),
    "results_identity": _results("study.json"),
}


def attempt(reader: str, data: bytes, folder: Path) -> str:
    """Read bytes in an empty folder; the refusal, or "". Anything but one line raises."""
    harmless = SimpleNamespace(import_module=_harmless)
    with patch.object(toml_system, "importlib", harmless), patch.object(capture, "importlib", harmless):
        try:
            READERS[reader](data, folder)
        except InputError as error:
            return one_line(error)
    return ""


def one_line(error: InputError) -> str:
    """The refusal; raises AssertionError where it is not one line."""
    line = str(error)
    if not line.isprintable() or not 10 < len(line) < 5000:
        raise AssertionError(f"the refusal is not one line: {line!r}")
    return line


def _harmless(name: str) -> object:
    """In place of importing whatever a system or study file names: two modules of our own."""
    if name not in ("snarelab.cosim.participants.oscillator", "snarelab.tolerance.ground"):
        raise ImportError(name)
    return importlib.import_module(name)
