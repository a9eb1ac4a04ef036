"""modelDescription.xml, for FMI 2.0 and 3.0."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from .. import __version__
from .equations import ModelVariable
from .units import DISPLAY, fmi_name, fmi_unit

_LICENCE = "Apache-2.0"


@dataclass(frozen=True)
class ModelInfo:
    """What the description says besides the variables.

    Parameters
    ----------
    name, identifier, description, token : str
    step, stop : float
        Default experiment [s].
    derivatives : bool
        Whether directional derivatives are provided.
    interpolates : bool
        Whether FMI 2's input derivatives are taken.
    needs_tool : bool
        Whether a process outside computes, so that the FMU needs a tool to run.
    saves : bool
        Whether states can be saved, restored and serialised.
    compiled_from : str
        Name of the source file to compile.
    """

    name: str
    identifier: str
    description: str
    token: str
    step: float
    stop: float
    derivatives: bool
    interpolates: bool
    needs_tool: bool
    saves: bool
    compiled_from: str


def model_description(about: ModelInfo, variables: tuple[ModelVariable, ...], version: int) -> str:
    """XML text; value references are 0 for time, then one row of inputs, parameters and outputs."""
    ordered = [v for causality in ("input", "parameter", "output") for v in variables if v.causality == causality]
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{version}.0",
            "modelName": about.name,
            ("guid" if version == 2 else "instantiationToken"): about.token,
            "description": about.description,
            "version": __version__,
            "license": _LICENCE,
            "generationTool": f"snarelab {__version__}",
            "generationDateAndTime": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
            "variableNamingConvention": "flat",
        },
    )
    (_interface2 if version == 2 else _interface3)(root, about)
    _units(root, {v.unit for v in ordered} - {"1", ""} | {"s"})
    categories = ET.SubElement(root, "LogCategories")
    for name in ("logStatusDiscard", "logStatusError"):
        ET.SubElement(categories, "Category", {"name": name})
    ET.SubElement(
        root, "DefaultExperiment", {"startTime": "0", "stopTime": repr(about.stop), "stepSize": repr(about.step)}
    )
    (_variables2 if version == 2 else _variables3)(root, ordered)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def build_description(about: ModelInfo) -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": about.identifier})
    sources = ET.SubElement(configuration, "SourceFileSet", {"language": "C99"})
    ET.SubElement(sources, "SourceFile", {"name": about.compiled_from})
    ET.SubElement(configuration, "Library", {"name": "m", "external": "true"})
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _interface2(root: ET.Element, about: ModelInfo) -> None:
    element = ET.SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": about.identifier,
            "needsExecutionTool": _bool(about.needs_tool),
            "canHandleVariableCommunicationStepSize": "true",
            "canInterpolateInputs": _bool(about.interpolates),
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": _bool(about.saves),
            "canSerializeFMUstate": _bool(about.saves),
            "providesDirectionalDerivative": _bool(about.derivatives),
        },
    )
    ET.SubElement(ET.SubElement(element, "SourceFiles"), "File", {"name": about.compiled_from})


def _interface3(root: ET.Element, about: ModelInfo) -> None:
    ET.SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": about.identifier,
            "needsExecutionTool": _bool(about.needs_tool),
            "canBeInstantiatedOnlyOncePerProcess": "false",
            "canGetAndSetFMUState": _bool(about.saves),
            "canSerializeFMUState": _bool(about.saves),
            "providesDirectionalDerivatives": _bool(about.derivatives),
            "canHandleVariableCommunicationStepSize": "true",
        },
    )


def _units(root: ET.Element, used: Iterable[str]) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for text in sorted(used):
        unit = fmi_unit(text)
        element = ET.SubElement(definitions, "Unit", {"name": unit.name})
        base = {name: str(power) for name, power in unit.exponents.items()}
        if unit.factor != 1:
            base["factor"] = repr(unit.factor)
        if unit.offset:
            base["offset"] = repr(unit.offset)
        ET.SubElement(element, "BaseUnit", base)
        if text in DISPLAY:
            name, factor = DISPLAY[text]
            ET.SubElement(element, "DisplayUnit", {"name": name, "factor": repr(factor)})


def _quantity(v: ModelVariable) -> dict[str, str]:
    """Unit, display unit and bounds."""
    found = {}
    if v.unit not in ("1", ""):
        found["unit"] = fmi_name(v.unit)
        if v.unit in DISPLAY:
            found["displayUnit"] = DISPLAY[v.unit][0]
    if np.isfinite(v.minimum):
        found["min"] = repr(float(v.minimum))
    if np.isfinite(v.maximum):
        found["max"] = repr(float(v.maximum))
    if v.causality != "output":
        found["start"] = repr(float(v.start))
    return found


def _kind(v: ModelVariable) -> dict[str, str]:
    """Causality, variability and initial."""
    if v.causality == "parameter":
        return {"causality": "parameter", "variability": "fixed" if v.fixed else "tunable", "initial": "exact"}
    if v.causality == "input":
        return {"causality": "input", "variability": "continuous"}
    return {"causality": "output", "variability": "continuous", "initial": "calculated"}


def _variables2(root: ET.Element, ordered: list[ModelVariable]) -> None:
    listed = ET.SubElement(root, "ModelVariables")
    independent = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    element = ET.SubElement(listed, "ScalarVariable", independent | {"description": "simulation time"})
    ET.SubElement(element, "Real", {"unit": "s"})
    for reference, v in enumerate(ordered, 1):
        shown = {"name": v.name, "valueReference": str(reference), "description": v.description}
        ET.SubElement(ET.SubElement(listed, "ScalarVariable", shown | _kind(v)), "Real", _quantity(v))
    structure = ET.SubElement(root, "ModelStructure")
    outputs, initial = ET.SubElement(structure, "Outputs"), ET.Element("InitialUnknowns")
    index = {v.name: k for k, v in enumerate(ordered, 2)}  # counted from 1, time first
    for v in ordered:
        if v.causality == "output":
            unknown = {"index": str(index[v.name])}
            if v.depends is not None:
                unknown["dependencies"] = " ".join(str(index[name]) for name in v.depends)
            ET.SubElement(outputs, "Unknown", unknown)
            ET.SubElement(initial, "Unknown", {"index": str(index[v.name])})
    if len(outputs):
        structure.append(initial)
    else:
        structure.remove(outputs)


def _variables3(root: ET.Element, ordered: list[ModelVariable]) -> None:
    listed = ET.SubElement(root, "ModelVariables")
    independent = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ET.SubElement(listed, "Float64", independent | {"description": "simulation time", "unit": "s"})
    for reference, v in enumerate(ordered, 1):
        shown = {"name": v.name, "valueReference": str(reference), "description": v.description}
        ET.SubElement(listed, "Float64", shown | _kind(v) | _quantity(v))
    structure = ET.SubElement(root, "ModelStructure")
    reference = {v.name: k for k, v in enumerate(ordered, 1)}
    outputs = [v for v in ordered if v.causality == "output"]
    for v in outputs:
        unknown = {"valueReference": str(reference[v.name])}
        if v.depends is not None:
            unknown["dependencies"] = " ".join(str(reference[name]) for name in v.depends)
        ET.SubElement(structure, "Output", unknown)
    for v in outputs:
        ET.SubElement(structure, "InitialUnknown", {"valueReference": str(reference[v.name])})


def _bool(value: bool) -> str:
    return "true" if value else "false"
