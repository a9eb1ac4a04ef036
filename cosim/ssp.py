"""Systems in SSP 1.0 files (System Structure and Parameterization, Modelica Association 2019): reading.

Read are FMU components, systems inside systems, connections with linear transformations, and parameter sets and
mappings, inside the description or in files of the archive. A system inside a system is dissolved: its component
``arm`` becomes the participant ``inner_arm``. What has no counterpart here is refused by name.
"""

import posixpath
import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

from ..errors import InputError
from ..recordings import nearest
from .fmi_variables import pint_unit
from .participant import Participant
from .setup import Hosting, Setup
from .ssp_parameters import Values, bound_parameters
from .system import Connection, System
from .units import conversion

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
RUN = "urn:snarelab:cosim"
ENTRY = "SystemStructure.ssd"
_NAMES = {"ssd": SSD, "ssc": SSC, "run": RUN}
_FMU = "application/x-fmu-sharedlibrary"
_LARGEST = 64 << 20  # bytes of a description; FMUs have their own bounds
_LARGEST_FMU = 4 << 30

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
    """Read a system and build its participants; raises InputError with the file's name for whatever is wrong in it."""
    folder = Path(tempfile.mkdtemp(prefix="snarelab-ssp-"))
    built: dict[str, Participant] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            return _read(archive, path, hosting, folder, built)
    except zipfile.BadZipFile:
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f"{path}: is no SSP file (no ZIP archive)") from None
    except InputError as error:
        shutil.rmtree(folder, ignore_errors=True)
        for participant in built.values():
            participant.close()
        text = str(error)
        raise InputError(text if text.startswith(str(path)) else f"{path}: {text}") from None


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
    for name, (_, component) in flat.components.items():
        file = folder / f"{len(built)}" / posixpath.basename(unquote(component.get("source", "")))
        file.parent.mkdir()
        _extract(archive, component, name, file)
        built[name] = hosting.build(Fmu, file, name)
    connections = [_connection(flat, name, c, built) for name, (_, e) in flat.components.items() for c in _inputs(e)]
    parameters = _parameters(flat.values, flat, built)
    found = [c for c in connections if c is not None]
    system = System(built, found, parameters=parameters, name=root.get("name") or path.stem)
    weakref.finalize(system, shutil.rmtree, folder, True)  # the FMUs' files, should the system be written again
    return Setup(system, **_run(root))


def parsed(archive: zipfile.ZipFile, entry: str) -> ElementTree.Element:
    """An XML entry; refuses document types, which carry entity bombs."""
    try:
        info = archive.getinfo(entry)
    except KeyError:
        raise InputError(f"has no {entry}; get the file again") from None
    if info.file_size > _LARGEST:
        raise InputError(f"{entry}: would unpack to {info.file_size} bytes; {_LARGEST} is the most that is read")
    try:
        return ElementTree.fromstring(archive.read(info), ElementTree.XMLParser(target=_NoDoctype()))
    except ElementTree.ParseError as error:
        raise InputError(f"{entry}: is no XML that can be read ({error})") from None


class _NoDoctype(ElementTree.TreeBuilder):
    def doctype(self, name: str, *_: Any) -> None:
        raise InputError(f"an XML file declares a document type {name!r}; SSP files have none")


def _flatten(archive: zipfile.ZipFile, system: ElementTree.Element, path: str, flat: _Flat) -> None:
    """Collect components, connections and parameters of a system and of those inside it."""
    flat.values += bound_parameters(archive, system, path)
    for element in system.iterfind("ssd:Elements/*", _NAMES):
        kind, name = element.tag.rpartition("}")[2], element.get("name", "")
        below = f"{path}.{name}" if path else name
        if kind == "System":
            _flatten(archive, element, below, flat)
        elif kind == "Component" and element.get("type", _FMU) == _FMU:
            flat.components[below.replace(".", "_")] = below, element
            flat.values += bound_parameters(archive, element, below)
        else:
            raise InputError(f"element {below!r} is a {element.get('type', kind)}; FMUs and systems can be read")
    for connection in system.iterfind("ssd:Connections/ssd:Connection", _NAMES):
        start, end = _ends(connection, system, path)
        factor, offset = 1.0, 0.0
        for transformation in connection.iterfind("ssc:*", _NAMES):
            if not transformation.tag.endswith("}LinearTransformation"):
                raise InputError(f"{'.'.join(start)} -> {'.'.join(end)}: only linear transformations can be read")
            factor, offset = (float(transformation.get(key, d)) for key, d in (("factor", 1.0), ("offset", 0.0)))
        flat.feeds[end] = (start, factor, offset)
        if connection.get("suppressUnitConversion") in ("true", "1"):
            flat.unconverted.add(end)


def _ends(connection: ElementTree.Element, system: ElementTree.Element, path: str) -> tuple[Place, Place]:
    """Both ends, the giving one first; SSP lets a connection be written either way round."""
    places: list[Place] = []
    gives: list[bool] = []
    elements = {e.get("name"): e for e in system.iterfind("ssd:Elements/*", _NAMES)}
    for side in ("start", "end"):
        name, connector = connection.get(f"{side}Element"), connection.get(f"{side}Connector", "")
        owner = system if name is None else elements.get(name)
        if owner is None:
            raise InputError(f"a connection names the element {name!r}, which is not there")
        kind = next(
            (
                c.get("kind")
                for c in owner.iterfind("ssd:Connectors/ssd:Connector", _NAMES)
                if c.get("name") == connector
            ),
            None,
        )
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


def _extract(archive: zipfile.ZipFile, component: ElementTree.Element, name: str, file: Path) -> None:
    source = unquote(component.get("source", ""))
    try:
        info = archive.getinfo(posixpath.normpath(source))
    except KeyError:
        raise InputError(f"component {name!r}: {source!r} is not in the archive") from None
    if info.file_size > _LARGEST_FMU:
        raise InputError(f"component {name!r}: {source!r} would unpack to {info.file_size} bytes; that is refused")
    with archive.open(info) as stream, file.open("wb") as copy:
        shutil.copyfileobj(stream, copy)


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
                run[key] = float(experiment.get(attribute, "0"))
    own = root.find("ssd:Annotations/ssc:Annotation/run:Run", _NAMES)
    if own is not None:
        run |= {key: own.attrib[key] for key in ("scheme", "hold") if key in own.attrib}
        if "step" in own.attrib:
            run["step"] = float(own.attrib["step"])
        run["iterate"] = own.get("iterate") == "true"
    return run
