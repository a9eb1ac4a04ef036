"""Systems in SSP 1.0 files (System Structure and Parameterization, Modelica Association 2019): reading.

Read are FMU components, systems inside systems, connections with linear transformations, and parameter sets and
mappings, inside the description or in files of the archive. An input that nothing is connected to keeps the start value
that its FMU gives, as SSP has it. A system inside a system is dissolved: its component
``arm`` becomes the participant ``inner_arm``. What has no counterpart here is refused by name.
"""

import posixpath
import shutil
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

from ..errors import InputError, nearest
from ..files import ZIP_FAULTS
from ..scratch import scratch_folder
from .experiment import Setup
from .fmi_variables import pint_unit
from .hosting import Hosting
from .participant import Participant
from .ssp_parameters import Values, bound_parameters, number, transformation
from .system import Connection, System
from .units import conversion

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
RUN = "urn:snarelab:cosim"
ENTRY = "SystemStructure.ssd"
_NAMES = {"ssd": SSD, "ssc": SSC, "run": RUN}
_FMU = "application/x-fmu-sharedlibrary"
_LARGEST = 16 << 20  # bytes of a description; read, it takes fifty times as much
_LARGEST_FMUS = 4 << 30  # bytes of all FMUs together
_MOST, _DEEPEST = 500, 32  # components, and levels of systems

Place = tuple[str, str]
"""An element's path and a connector's name."""


@dataclass
class _Flat:
    """The system without its levels."""

    components: dict[str, tuple[str, ElementTree.Element]] = field(default_factory=dict)
    feeds: dict[Place, tuple[Place, float, float]] = field(default_factory=dict)
    unconverted: set[Place] = field(default_factory=set)
    values: list[Values] = field(default_factory=list)


def read_ssp(path: Path, hosting: Hosting) -> Setup:
    """Read a system and build its participants; raises InputError with the file's name for a mistake in it."""
    folder = Path(scratch_folder("ssp-"))
    built: dict[str, Participant] = {}
    try:
        with _opened(path) as archive:
            return _read(archive, path, hosting, folder, built)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        for participant in built.values():
            participant.close()
        if isinstance(error, InputError):
            text = str(error)
            raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None
        raise


def _opened(path: Path) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(path)
    except ZIP_FAULTS as error:
        raise InputError(f"is no SSP file (no ZIP archive: {error}); get the file again") from None


def _read(archive: zipfile.ZipFile, path: Path, hosting: Hosting, folder: Path, built: dict[str, Participant]) -> Setup:
    from .participants.fmu import Fmu

    root = parsed(archive, ENTRY)
    if root.get("version", "1.0") != "1.0":
        raise InputError(f"{ENTRY}: is of SSP {root.get('version')}; 1.0 can be read")
    top = root.find("ssd:System", _NAMES)
    if top is None:
        raise InputError(f"{ENTRY}: has no System; get the file again")
    flat = _Flat()
    _flatten(archive, top, "", flat)
    most = _LARGEST_FMUS
    for name, (_, component) in flat.components.items():
        file = _extract(archive, component, name, folder / f"{len(built)}", most)
        most -= file.stat().st_size
        built[name] = hosting.build(Fmu, file, name)
    connections = [_connection(flat, name, c, built) for name, (_, e) in flat.components.items() for c in _inputs(e)]
    parameters = _parameters(flat.values, flat, built)
    found = [c for c in connections if c is not None]
    bound = {c.target for c in found} | set(parameters)
    inputs = {f"{name}.{v.name}": v for name, one in built.items() for v in one.variables if v.causality == "input"}
    loose = {name: v.start for name, v in inputs.items() if name not in bound}
    system = System(built, found, parameters={**parameters, **loose}, name=root.get("name") or path.stem)
    weakref.finalize(system, shutil.rmtree, folder, True)  # the FMUs' files, should the system be written again
    return Setup(system, **_run(root), open=tuple(loose))


def parsed(archive: zipfile.ZipFile, entry: str) -> ElementTree.Element:
    """An XML entry; refuses document types, which carry entity bombs."""
    try:
        info = archive.getinfo(entry)
    except KeyError:
        raise InputError(f"has no {entry}; get the file again") from None
    if info.file_size > _LARGEST:
        raise InputError(f"{entry}: would unpack to {info.file_size} bytes; {_LARGEST} is the most that is read")
    try:
        content = archive.read(info)
    except ZIP_FAULTS as error:
        raise InputError(f"{entry}: cannot be unpacked ({error}); get the file again") from None
    try:
        return ElementTree.fromstring(content, ElementTree.XMLParser(target=_NoDoctype()))
    except InputError:
        raise
    except (ElementTree.ParseError, ValueError, LookupError) as error:  # the last two: an encoding that expat lacks
        raise InputError(f"{entry}: is no XML that can be read ({error})") from None


class _NoDoctype(ElementTree.TreeBuilder):
    def doctype(self, name: str, *_: Any) -> None:
        raise InputError(f"an XML file declares a document type {name!r}; SSP files have none")


def _flatten(archive: zipfile.ZipFile, system: ElementTree.Element, path: str, flat: _Flat) -> None:
    """Collect components, connections and parameters of a system and of those inside it."""
    flat.values += bound_parameters(partial(parsed, archive), system, path)
    for element in system.iterfind("ssd:Elements/*", _NAMES):
        kind, name = element.tag.rpartition("}")[2], element.get("name", "")
        below = f"{path}.{name}" if path else name
        if not name or below.replace(".", "_") in flat.components:
            raise InputError(f"two elements are called {below!r}, or one has no name; name each apart")
        if len(flat.components) == _MOST or path.count(".") == _DEEPEST:
            raise InputError(f"has more than {_MOST} components, or systems {_DEEPEST} deep in one another; cut it")
        if kind == "System":
            _flatten(archive, element, below, flat)
        elif kind == "Component" and element.get("type", _FMU) == _FMU:
            flat.components[below.replace(".", "_")] = below, element
            flat.values += bound_parameters(partial(parsed, archive), element, below)
        else:
            raise InputError(f"element {below!r} is a {element.get('type', kind)}; FMUs and systems can be read")
    kinds = {e.get("name"): _kinds(e) for e in system.iterfind("ssd:Elements/*", _NAMES)} | {None: _kinds(system)}
    for connection in system.iterfind("ssd:Connections/ssd:Connection", _NAMES):
        start, end = _ends(connection, kinds, path)
        factor, offset = transformation(connection, f"{'.'.join(start)} -> {'.'.join(end)}")
        flat.feeds[end] = (start, factor, offset)
        if connection.get("suppressUnitConversion") in ("true", "1"):
            flat.unconverted.add(end)


def _kinds(element: ElementTree.Element) -> dict[str, str]:
    return {c.get("name", ""): c.get("kind", "") for c in element.iterfind("ssd:Connectors/ssd:Connector", _NAMES)}


def _ends(
    connection: ElementTree.Element, kinds: Mapping[str | None, Mapping[str, str]], path: str
) -> tuple[Place, Place]:
    """Both ends, the giving one first; SSP lets a connection be written either way round."""
    places: list[Place] = []
    gives: list[bool] = []
    for side in ("start", "end"):
        name, connector = connection.get(f"{side}Element"), connection.get(f"{side}Connector", "")
        if name not in kinds:
            raise InputError(f"a connection names the element {name!r}, which is not there")
        kind = kinds[name].get(connector)
        if kind is None:
            raise InputError(f"a connection names the connector {connector!r} of {name or path!r}, which is not there")
        # Seen from inside, a system's own inputs give and its outputs take.
        gives.append(kind == "input" if name is None else kind == "output")
        below = path if name is None else f"{path}.{name}" if path else name
        places.append((below, connector))
    return (places[0], places[1]) if gives[0] or not gives[1] else (places[1], places[0])


def _inputs(component: ElementTree.Element) -> list[ElementTree.Element]:
    return [c for c in component.iterfind("ssd:Connectors/ssd:Connector", _NAMES) if c.get("kind") == "input"]


def _connection(
    flat: _Flat, name: str, connector: ElementTree.Element, built: Mapping[str, Participant]
) -> Connection | None:
    """The connection into a component's input, traced through the borders of systems to the output it comes from."""
    target = connector.get("name", "")
    names = {path: key for key, (path, _) in flat.components.items()}
    place, factor, offset = (flat.components[name][0], target), 1.0, 0.0
    seen = {place}
    while place in flat.feeds:
        place, own_factor, own_offset = flat.feeds[place]
        offset += factor * own_offset
        factor *= own_factor
        if place in seen:
            raise InputError(f"the connections into {name}.{target} run in a circle")
        seen.add(place)
    if len(seen) == 1 or place[0] not in names:
        return None
    _same_unit(built[name], target, connector)
    units = (_unit(built[names[place[0]]], place[1]), _unit(built[name], target))
    if seen & flat.unconverted and conversion(*units) != (1.0, 0.0):
        raise InputError(f"{name}.{target}: {units[0]} is to be read as {units[1]} unconverted, which is not supported")
    return Connection(f"{names[place[0]]}.{place[1]}", f"{name}.{target}", factor, offset)


def _same_unit(participant: Participant, name: str, connector: ElementTree.Element) -> None:
    """A connector's unit must be the FMU's own, where both say one and pint reads it."""
    declared = next((e.get("unit", "") for e in connector.iterfind("ssc:Real", _NAMES)), "")
    unit = _unit(participant, name)
    if declared and unit and conversion(pint_unit(declared), unit) != (1.0, 0.0):
        raise InputError(f"connector {name!r} is in {declared}, the FMU's variable in {unit}; make them the same")


def _unit(participant: Participant, name: str) -> str:
    return next((v.unit for v in participant.variables if v.name == name), "")


def _extract(archive: zipfile.ZipFile, component: ElementTree.Element, name: str, folder: Path, most: int) -> Path:
    """Unpack a component's FMU into a new folder; its path."""
    source = unquote(component.get("source", ""))
    try:
        info = archive.getinfo(posixpath.normpath(source))
    except KeyError:
        raise InputError(f"component {name!r}: {source!r} is not in the archive") from None
    file = folder / posixpath.basename(info.filename)
    if info.is_dir() or file.parent != folder or file.name in ("", ".", ".."):
        raise InputError(f"component {name!r}: {source!r} is no file of the archive")
    if info.file_size > most:
        raise InputError(
            f"component {name!r}: {source!r} would unpack to {info.file_size} bytes, and {most} are left of the "
            f"{_LARGEST_FMUS} that all FMUs may have; that is refused"
        )
    try:
        folder.mkdir()
        with archive.open(info) as stream, file.open("wb") as copy:
            shutil.copyfileobj(stream, copy)
    except ZIP_FAULTS as error:
        raise InputError(f"component {name!r}: {source!r} cannot be unpacked ({error}); get the file again") from None
    return file


def _parameters(values: list[Values], flat: _Flat, built: Mapping[str, Participant]) -> dict[str, float]:
    """Parameters as the system takes them, in the variables' own units; those of an outer level win."""
    variables = {
        f"{path}.{v.name}": (f"{key}.{v.name}", v.unit)
        for key, (path, _) in flat.components.items()
        for v in built[key].variables
    }
    found: dict[str, float] = {}
    for value in sorted(values, key=lambda v: -v.level):
        if value.name not in variables:
            raise InputError(f"parameter {value.name!r} is no variable; nearest is {nearest(value.name, variables)!r}")
        name, unit = variables[value.name]
        factor, offset = conversion(pint_unit(value.unit), unit)
        found[name] = value.factor * (factor * value.value + offset) + value.offset
    return found


def _run(root: ElementTree.Element) -> dict[str, Any]:
    """Times of the default experiment, and how snarelab ran it, where the file says."""
    run: dict[str, Any] = {}
    experiment = root.find("ssd:DefaultExperiment", _NAMES)
    if experiment is not None:
        for key, attribute in (("start", "startTime"), ("stop", "stopTime")):
            if experiment.get(attribute) is not None:
                run[key] = number(experiment, attribute, 0.0, "DefaultExperiment")
    own = root.find("ssd:Annotations/ssc:Annotation/run:Run", _NAMES)
    if own is not None:
        run |= {key: own.attrib[key] for key in ("scheme", "hold") if key in own.attrib}
        if "step" in own.attrib:
            run["step"] = number(own, "step", 0.0, "Run")
        run["iterate"] = own.get("iterate") == "true"
    return run
