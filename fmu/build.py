"""Compile a model's sources and pack everything into one FMU file, all or nothing."""

import os
import shlex
import subprocess
import tempfile
import zipfile
from importlib.resources import files
from pathlib import Path

from ..errors import InputError
from ..files import written_whole
from ..fmi.binaries import binary_folder, library_suffix
from ..models.c_library import find_compiler
from .c_files import source_files
from .description import ModelInfo, build_description, model_description
from .equations import Equations, ModelVariable
from .page import icon, page

# -O1: straight-line code gains next to nothing from more. No contraction: the same bits on every machine.
FLAGS = ("-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", "-fvisibility=hidden", "-w")


def write_fmu(equations: Equations, path: str | Path, version: int) -> Path:
    """Write a self-contained FMU.

    Parameters
    ----------
    equations : Equations
    path : path
        Where; an FMU that is there is replaced.
    version : 2 or 3
        Of FMI.

    Raises
    ------
    InputError
        No C compiler, or a place that cannot be written.
    """
    sources, token = source_files(equations, version)
    about = ModelInfo(
        name=equations.name,
        identifier=equations.name,
        description=equations.description,
        token=token,
        step=1e-3,
        stop=10.0,
        derivatives=True,
        interpolates=True,
        needs_tool=False,
        saves=True,
        compiled_from=f"fmi{version}.c",
    )
    return pack(about, equations.variables, sources, {}, path, version, ("-lm",))


def pack(
    about: ModelInfo,
    variables: tuple[ModelVariable, ...],
    sources: dict[str, str],
    resources: dict[str, str],
    path: str | Path,
    version: int,
    libraries: tuple[str, ...] = (),
) -> Path:
    """Compile the sources and write the archive: description, binary, sources, resources, page, licence, icon."""
    path = Path(path)
    content = {
        "modelDescription.xml": model_description(about, variables, version),
        "documentation/index.html": page(about, variables, version),
        "documentation/licenses/license.txt": _licence(),
        **{f"sources/{name}": text for name, text in sources.items()},
        **{f"resources/{name}": text for name, text in resources.items()},
    }
    if version == 3:
        content["sources/buildDescription.xml"] = build_description(about)
    image = "model.png" if version == 2 else "terminalsAndIcons/icon.png"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8")
        library = folder / f"{about.identifier}{library_suffix()}"
        compile_library(folder / about.compiled_from, library, libraries)
        binary = library.read_bytes()
    with (
        written_whole(path, "choose a folder that exists") as part,
        zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, text in content.items():
            archive.writestr(name, text)
        archive.writestr(image, icon())
        if version == 3:
            archive.writestr("terminalsAndIcons/terminalsAndIcons.xml", _TERMINALS)
        archive.writestr(f"binaries/{binary_folder(version)}/{library.name}", binary)
    return path


_TERMINALS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation>
    <CoordinateSystem x1="-100" y1="-100" x2="100" y2="100"/>
    <Icon x1="-100" y1="-100" x2="100" y2="100"/>
  </GraphicalRepresentation>
</fmiTerminalsAndIcons>
"""


def compile_library(source: Path, library: Path, libraries: tuple[str, ...]) -> None:
    """Build a shared library from one C file; InputError where there is no compiler or it fails."""
    try:
        compiler, _ = find_compiler(os.environ.get("SNARELAB_CC", ""), os.environ.get("PATH", ""))
    except OSError as problem:
        raise InputError(f"an FMU needs a C compiler: {problem}; install one, or name one in SNARELAB_CC") from None
    command = [*compiler, *FLAGS, str(source), "-o", str(library), *libraries]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode:
        complaint = (run.stderr.strip().splitlines() or ["no message"])[0]
        raise InputError(f"the C compiler failed on {shlex.join(command)}: {complaint}; name another in SNARELAB_CC")


def _licence() -> str:
    return (files("snarelab.fmu") / "c" / "licence.txt").read_text(encoding="utf-8")
