"""Open any FMU: one that could do harm or cannot run is refused, with all its problems, before its code runs."""

import re
import shutil
import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any
from xml.parsers import expat

from ..errors import InputError
from ..extras import needed_for
from ..files import ZIP_FAULTS
from .binaries import binary_folder, library_suffix
from .elf import ElfFault, exported_symbols

_TOTAL, _ENTRIES, _XML = 4 << 30, 20_000, 64 << 20
_ANYHOW, _RATIO = 32 << 20, 100  # bytes that may come of anything, as of a table of zeros; above, a ratio is demanded
_READ = ("modelDescription.xml", "sources/buildDescription.xml", "terminalsAndIcons/terminalsAndIcons.xml")

_CALLS = {
    2: (
        "fmi2GetVersion fmi2Instantiate fmi2FreeInstance fmi2SetupExperiment fmi2EnterInitializationMode "
        "fmi2ExitInitializationMode fmi2Terminate fmi2GetReal fmi2SetReal fmi2DoStep",
        "fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate",
        "fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate",
        "fmi2GetDirectionalDerivative",
    ),
    3: (
        "fmi3GetVersion fmi3InstantiateCoSimulation fmi3FreeInstance fmi3EnterInitializationMode "
        "fmi3ExitInitializationMode fmi3Terminate fmi3GetFloat64 fmi3SetFloat64 fmi3DoStep",
        "fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState",
        "fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState",
        "fmi3GetDirectionalDerivative",
    ),
}


@dataclass(frozen=True)
class FmuArchive:
    """An FMU, checked and unpacked.

    Parameters
    ----------
    path, folder : Path
        The file, and where it was unpacked.
    description : fmpy.model_description.ModelDescription
    version : 2 or 3
        Of FMI.
    binary : Path
        The shared library for this platform.
    """

    path: Path
    folder: Path
    description: Any
    version: int
    binary: Path


def open_fmu(path: str | Path, folder: str | Path) -> FmuArchive:
    """Check an FMU for co-simulation, and unpack it.

    Parameters
    ----------
    path : path
    folder : path
        An empty or new folder; nothing is written there unless the archive is sound.

    Raises
    ------
    InputError
        With all problems in one line: entries that lead outside the folder, links, encryption, absurd sizes, FMI's own
        XML with a document type (entity bombs), no or a broken model description, or two, no co-simulation, an FMI
        version other than 2.0 and 3.0, no binary for this platform, or a binary without functions that the description
        promises. Whether binary and description are of one build, the binary alone can check, by GUID or token,
        when it is instantiated.
    """
    path, folder = Path(path), Path(folder)
    if not path.is_file():
        raise InputError(f"{path}: is not there; give the path of an .fmu file")
    try:
        with zipfile.ZipFile(path) as archive:
            _demand(path, list(_entry_problems(archive)))
            _demand(path, list(_xml_problems(archive)))
            _unpack(archive, folder)
    except InputError:
        raise
    except ZIP_FAULTS as error:
        raise InputError(
            f"{path}: is no sound ZIP archive ({' '.join(str(error).split())}); get the FMU again"
        ) from None
    description = _read(path, folder)
    problems = list(_description_problems(description))
    _demand(path, problems)
    version = int(description.fmiVersion[0])
    identifier = description.coSimulation.modelIdentifier
    binary = folder / "binaries" / binary_folder(version) / f"{identifier}{library_suffix()}"
    _demand(path, list(_binary_problems(folder, binary, description, version)))
    return FmuArchive(path, folder, description, version, binary)


def _demand(path: Path, problems: list[str]) -> None:
    if problems:
        count = f"{len(problems)} problems: " if len(problems) > 1 else ""
        shown = "; ".join(problems[:20]) + (f"; and {len(problems) - 20} more" if len(problems) > 20 else "")
        raise InputError(f"{path}: {count}{shown}")


def _entry_problems(archive: zipfile.ZipFile) -> Iterator[str]:
    entries = archive.infolist()
    if len(entries) > _ENTRIES:
        yield f"{len(entries)} entries, more than {_ENTRIES}"
        return
    seen: dict[str, zipfile.ZipInfo] = {}
    for entry in entries:
        name, parts = entry.orig_filename, PurePosixPath(entry.orig_filename.replace("\\", "/")).parts
        shown = ascii(name[:80])
        if not entry.filename:  # what stands before a NUL; every file has a name
            yield f"entry {shown} has no name"
        if name.startswith(("/", "\\")) or ".." in parts or re.match(r"[A-Za-z]:", name) or "\0" in name:
            yield f"entry {shown} leads outside the archive"
        elif "\\" in name:
            yield f"entry {shown} has a backslash, where FMI wants a slash"
        if stat.S_ISLNK(entry.external_attr >> 16):
            yield f"entry {shown} is a link"
        if entry.flag_bits & 1:
            yield f"entry {shown} is encrypted"
        twin = seen.get(name)
        if twin is not None and (twin.CRC, twin.file_size) != (entry.CRC, entry.file_size) and _decides(name):
            yield f"entry {shown} is there twice, and not the same"
        seen[name] = entry
    yield from _growth_problems(entries)
    total = sum(entry.file_size for entry in entries)
    if total > _TOTAL:
        yield f"{total / 2**30:.1f} GiB when unpacked, more than {_TOTAL >> 30} GiB"
    if "modelDescription.xml" not in seen:
        yield "no modelDescription.xml at its root: it is no FMU"


def _decides(name: str) -> bool:
    """Whether readers that take different ones of two entries would run different FMUs; else the last counts."""
    return name == "modelDescription.xml" or name.startswith("binaries/")


def _growth_problems(entries: list[zipfile.ZipInfo]) -> Iterator[str]:
    """Bombs: what is packed small and large when unpacked, all entries together."""
    grown = [e for e in entries if e.file_size > _RATIO * e.compress_size]
    if sum(e.file_size for e in grown) > _ANYHOW:
        worst = max(grown, key=lambda e: e.file_size)
        factor = worst.file_size // max(worst.compress_size, 1)
        yield f"entry {worst.orig_filename[:80]!a} would grow {factor}-fold when unpacked"


def _xml_problems(archive: zipfile.ZipFile) -> Iterator[str]:
    for entry in archive.infolist():
        if entry.filename not in _READ:  # others are the model's own, and read by nobody here
            continue
        if entry.file_size > _XML:
            yield f"{entry.filename} has {entry.file_size >> 20} MiB, more than {_XML >> 20}"
            continue
        parser, doctypes = expat.ParserCreate(), []

        def doctype(name: str, *_: object, found: list[str] = doctypes) -> None:
            found.append(name)
            raise _Doctype

        parser.StartDoctypeDeclHandler = doctype
        try:
            parser.Parse(archive.read(entry), True)
        except _Doctype:
            yield f"{entry.filename} has a document type, which FMI has no use for and entity bombs need"
        except (expat.ExpatError, ValueError, LookupError) as error:  # the last two: an encoding that expat lacks
            if entry.filename == "modelDescription.xml":
                yield f"{entry.filename} is not XML: {error}"


class _Doctype(Exception):
    """A document type was met; the rest is not worth reading."""


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """Write every file; sizes were checked, and zipfile reads no more than is declared."""
    root = folder.resolve()
    for entry in archive.infolist():
        place = (root / entry.filename).resolve()
        if not place.is_relative_to(root):
            raise zipfile.BadZipFile(f"entry {entry.filename!a} leads outside")
        if entry.is_dir():
            place.mkdir(parents=True, exist_ok=True)
            continue
        place.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, place.open("wb") as target:
            shutil.copyfileobj(source, target)


def _read(path: Path, folder: Path) -> Any:
    with needed_for(f"{path}: an FMU"):
        import fmpy
    try:
        return fmpy.read_model_description(str(folder), validate=False)
    except Exception as error:  # FMPy raises bare exceptions
        raise InputError(f"{path}: modelDescription.xml cannot be read ({' '.join(str(error).split())})") from None


def _description_problems(description: Any) -> Iterator[str]:
    if not re.match(r"(2\.|3\.)", description.fmiVersion):
        yield f"FMI {description.fmiVersion}; 2.0 and 3.0 can be run"
        return
    if description.coSimulation is None:
        yield "no co-simulation; export it with co-simulation"
        return
    identifier = description.coSimulation.modelIdentifier
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", identifier or ""):
        yield f"modelIdentifier {identifier!a} is no C identifier"
    names = Counter(v.name for v in description.modelVariables)
    for name in sorted(n for n, count in names.items() if count > 1):
        yield f"variable {name!r} is described twice"


def _binary_problems(folder: Path, binary: Path, description: Any, version: int) -> Iterator[str]:
    if not binary.is_file():
        there = sorted(
            str(f.relative_to(folder / "binaries")) for f in (folder / "binaries").glob("*/*") if f.is_file()
        )
        mend = "it has sources: run fmpy compile" if (folder / "sources").is_dir() else "ask for one from its maker"
        found = ", ".join(there) or "none"
        yield f"no binary {binary.relative_to(folder)} for this platform (there is {found}); {mend}"
        return
    if binary.suffix != ".so":
        return
    try:
        symbols = exported_symbols(binary)
    except ElfFault as fault:
        yield f"{binary.relative_to(folder)}: {fault}"
        return
    capable = description.coSimulation
    wanted = zip(
        _CALLS[version],
        (
            True,
            capable.canGetAndSetFMUstate,
            capable.canSerializeFMUstate,
            capable.providesDirectionalDerivative,
        ),
        strict=True,
    )
    missing = [name for names, promised in wanted if promised for name in names.split() if name not in symbols]
    if missing:
        yield f"the binary lacks {', '.join(missing)}, which the model description promises"
