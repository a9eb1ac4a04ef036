"""Writing a system as an SSP 1.0 file that other tools load: FMUs, connections, parameter sets."""

import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from ..errors import InputError
from ..extras import needed_for
from ..files import written_whole
from .experiment import Setup
from .participant import Participant
from .process import OwnProcess
from .ssp import ENTRY, RUN, SSC, SSD
from .ssp_parameters import SSV

_EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_TYPES = {"Real": "Real", "Float64": "Real", "Float32": "Real", "Boolean": "Boolean", "Enumeration": "Integer"}
_WHEN = (1980, 1, 1, 0, 0, 0)  # the same system is the same file


def write_ssp(setup: Setup, path: str | Path) -> None:
    """Write a system whose participants are all FMUs.

    Parameters are bound to their components, and how the master ran the system is an annotation, which other tools
    pass over; step control, power bonds and the limits of an iteration stay behind. The file appears whole or not at
    all. Raises InputError for participants that are no FMUs.
    """
    with needed_for("writing an SSP file"):
        import fmpy
    path, system = Path(path), setup.system
    files = {name: _file(name, participant) for name, participant in system.participants.items()}
    stored: dict[Path, str] = {}
    for name, file in files.items():
        taken = file.name in {Path(s).name for f, s in stored.items() if f != file}
        stored.setdefault(file, f"resources/{name + '-' if taken else ''}{file.name}")
    for prefix, uri in (("ssd", SSD), ("ssc", SSC), ("ssv", SSV), ("snarelab", RUN)):
        ElementTree.register_namespace(prefix, uri)
    root = ElementTree.Element(f"{{{SSD}}}SystemStructureDescription", version="1.0", name=system.name)
    top = ElementTree.SubElement(root, f"{{{SSD}}}System", name=system.name)
    elements = ElementTree.SubElement(top, f"{{{SSD}}}Elements")
    units: dict[str, Any] = {}
    for name, file in files.items():
        description = fmpy.read_model_description(str(file), validate=False)
        units |= {str(unit.name): unit.baseUnit for unit in description.unitDefinitions if unit.baseUnit is not None}
        component = ElementTree.SubElement(
            elements, f"{{{SSD}}}Component", name=name, type="application/x-fmu-sharedlibrary", source=stored[file]
        )
        _add_connectors(component, description, units)
        given = {k.partition(".")[2]: v for k, v in system.given.items() if k.startswith(f"{name}.")}
        if given:
            _add_parameters(component, description, given)
    _add_connections(top, setup)
    if units:
        holder = ElementTree.SubElement(root, f"{{{SSD}}}Units")
        for name, base in units.items():
            unit = ElementTree.SubElement(holder, f"{{{SSC}}}Unit", name=name)
            powers = {key: str(getattr(base, key)) for key in _EXPONENTS if getattr(base, key)}
            scale = {
                key: repr(getattr(base, key))
                for key, plain in (("factor", 1), ("offset", 0))
                if getattr(base, key) != plain
            }
            ElementTree.SubElement(unit, f"{{{SSC}}}BaseUnit", powers | scale)
    ElementTree.SubElement(
        root, f"{{{SSD}}}DefaultExperiment", startTime=repr(float(setup.start)), stopTime=repr(float(setup.stop))
    )
    notes = ElementTree.SubElement(root, f"{{{SSD}}}Annotations")
    note = ElementTree.SubElement(notes, f"{{{SSC}}}Annotation", type="snarelab.cosim")
    how = {"step": repr(float(setup.step)), "scheme": setup.scheme, "hold": setup.hold}
    ElementTree.SubElement(note, f"{{{RUN}}}Run", how, iterate="true" if setup.iterate else "false")
    ElementTree.indent(root)
    _pack(path, ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True), stored)


def _file(name: str, participant: Participant) -> Path:
    """The FMU behind a participant."""
    if isinstance(participant, OwnProcess) and participant.made[0].__name__ == "Fmu":
        return Path(participant.made[1][0])
    path = getattr(participant, "path", None)
    if not isinstance(path, Path) or path.suffix != ".fmu":
        raise InputError(f"participant {name!r} is no FMU, and SSP files hold FMUs; export it first")
    return path


def _add_connectors(component: ElementTree.Element, description: Any, units: dict[str, Any]) -> None:
    holder = ElementTree.SubElement(component, f"{{{SSD}}}Connectors")
    for v in description.modelVariables:
        if v.causality not in ("input", "output", "parameter") or v.type in ("String", "Binary", "Clock"):
            continue
        connector = ElementTree.SubElement(holder, f"{{{SSD}}}Connector", name=v.name, kind=v.causality)
        kind = _TYPES.get(v.type, "Integer")
        unit = v.unit or (v.declaredType.unit if v.declaredType else None)
        stated = {"unit": unit} if kind == "Real" and unit in units else {}
        ElementTree.SubElement(connector, f"{{{SSC}}}{kind}", stated)


def _add_parameters(component: ElementTree.Element, description: Any, given: dict[str, float]) -> None:
    bindings = ElementTree.SubElement(component, f"{{{SSD}}}ParameterBindings")
    binding = ElementTree.SubElement(bindings, f"{{{SSD}}}ParameterBinding")
    values = ElementTree.SubElement(binding, f"{{{SSD}}}ParameterValues")
    group = ElementTree.SubElement(values, f"{{{SSV}}}ParameterSet", version="1.0", name="initialValues")
    holder = ElementTree.SubElement(group, f"{{{SSV}}}Parameters")
    types = {v.name: _TYPES.get(v.type, "Integer") for v in description.modelVariables}
    for key, value in given.items():
        parameter = ElementTree.SubElement(holder, f"{{{SSV}}}Parameter", name=key)
        kind = types.get(key, "Real")
        text = {"Real": repr(value), "Boolean": "true" if value else "false"}.get(kind, str(round(value)))
        ElementTree.SubElement(parameter, f"{{{SSV}}}{kind}", value=text)


def _add_connections(top: ElementTree.Element, setup: Setup) -> None:
    if not setup.system.connections:
        return
    holder = ElementTree.SubElement(top, f"{{{SSD}}}Connections")
    for c in setup.system.connections:
        (a, start), (b, end) = ((name.partition(".")[0], name.partition(".")[2]) for name in (c.source, c.target))
        connection = ElementTree.SubElement(
            holder, f"{{{SSD}}}Connection", startElement=a, startConnector=start, endElement=b, endConnector=end
        )
        if (c.factor, c.offset) != (1.0, 0.0):
            ElementTree.SubElement(
                connection, f"{{{SSC}}}LinearTransformation", factor=repr(c.factor), offset=repr(c.offset)
            )


def _pack(path: Path, description: bytes, stored: dict[Path, str]) -> None:
    with written_whole(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(ENTRY, _WHEN), description)
        for file, entry in stored.items():
            archive.writestr(zipfile.ZipInfo(entry, _WHEN), file.read_bytes(), zipfile.ZIP_STORED)
