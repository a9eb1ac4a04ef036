"""Builds the two halves of the coupled oscillators as FMUs, for tests and for the bench; needs a C compiler."""

import os
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import Literal

import fmpy

from snarelab.models.c_library import find_compiler

SOURCE = Path(__file__).with_suffix(".c")
_PLATFORM = {2: "linux64", 3: "x86_64-linux"}
_PARAMETERS = (
    ("mass", 0, "kg", 1.0),
    ("stiffness", 1, "N/m", 10.0),
    ("damping", 2, "N.s/m", 0.0),
    ("position", 3, "m", None),
    ("speed", 4, "m/s", 0.0),
    ("coupling_stiffness", 5, "N/m", 3.0),
    ("coupling_damping", 6, "N.s/m", 0.0),
    ("fault", 7, "", 0.0),
    ("fault_time", 8, "s", 1e300),
)
_SIGNALS = {
    "left": (("force", 11, "N", "input"), ("x", 12, "m", "output"), ("v", 13, "m/s", "output")),
    "right": (
        ("x_left", 9, "m", "input"),
        ("v_left", 10, "m/s", "input"),
        ("x", 12, "m", "output"),
        ("v", 13, "m/s", "output"),
        ("force", 14, "N", "output"),
    ),
}
_UNITS = {
    "kg": 'kg="1"',
    "N/m": 'kg="1" s="-2"',
    "N.s/m": 'kg="1" s="-1"',
    "m": 'm="1"',
    "m/s": 'm="1" s="-1"',
    "s": 's="1"',
    "N": 'kg="1" m="1" s="-2"',
}


def build(
    folder: Path,
    side: Literal["left", "right"],
    fmi: Literal[2, 3] = 2,
    units: dict[str, str] | None = None,
    defined: tuple[str, ...] = (),
) -> Path:
    """Compile and pack ``folder/<side><fmi>.fmu``; ``units`` replaces units of variables, ``defined`` are macros."""
    name = f"{side}{fmi}"
    path = folder / f"{name}.fmu"
    with tempfile.TemporaryDirectory() as scratch:
        library = Path(scratch) / f"{name}.so"
        headers = Path(fmpy.__file__).parent / "c-code"
        options = [f"-DFMI={fmi}", f"-DSIDE={int(side == 'right')}", f"-I{headers}", "-O2", "-shared", "-fPIC", "-w"]
        options += [f"-D{name}" for name in defined]
        compiler, _ = find_compiler("", os.environ["PATH"])  # tests name other compilers, and none, for the tool
        subprocess.run([*compiler, *options, "-o", str(library), str(SOURCE), "-lm"], check=True)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", _description(name, side, fmi, units or {}))
            archive.write(library, f"binaries/{_PLATFORM[fmi]}/{name}.so")
    return path


def _description(name: str, side: str, fmi: int, units: dict[str, str]) -> str:
    signals = [(n, r, units.get(n) or u, c) for n, r, u, c in _SIGNALS[side]]
    at_start = float(side == "left")
    parameters = [(n, r, units.get(n) or u, at_start if v is None else v) for n, r, u, v in _PARAMETERS]
    used = sorted({u for _, _, u, _ in [*signals, *parameters] if u})
    bases = {u: f"<BaseUnit {_UNITS[u]}/>" if u in _UNITS else "" for u in used}
    defined = "".join(f'<Unit name="{u}">{base}</Unit>' for u, base in bases.items())
    variables = [_variable(fmi, n, r, u, "parameter", start) for n, r, u, start in parameters]
    variables += [_variable(fmi, n, r, u, c, 0.0 if c == "input" else None) for n, r, u, c in signals]
    if fmi == 3:
        variables.append('<Float64 name="time" valueReference="15" causality="independent" variability="continuous"/>')
    places = {n: len(parameters) + i + 1 for i, (n, *_) in enumerate(signals)}
    references = {n: r for n, r, *_ in signals}
    outputs = [(n, ["x_left", "v_left"] if n == "force" else []) for n, _, _, c in signals if c == "output"]
    if fmi == 2:
        unknowns = "".join(
            f'<Unknown index="{places[n]}" dependencies="{" ".join(str(places[d]) for d in on)}"/>' for n, on in outputs
        )
        initial = "".join(f'<Unknown index="{places[n]}"/>' for n, _ in outputs)
        structure = f"<Outputs>{unknowns}</Outputs><InitialUnknowns>{initial}</InitialUnknowns>"
        head = f'fmiVersion="2.0" guid="{name}" modelName="{name}"'
        able = 'canGetAndSetFMUstate="true" canSerializeFMUstate="true" canInterpolateInputs="true"'
    else:
        structure = "".join(
            f'<Output valueReference="{references[n]}" dependencies="{" ".join(str(references[d]) for d in on)}"/>'
            for n, on in outputs
        ) + "".join(f'<InitialUnknown valueReference="{references[n]}"/>' for n, _ in outputs)
        head = f'fmiVersion="3.0" instantiationToken="{name}" modelName="{name}"'
        able = 'canGetAndSetFMUState="true" canSerializeFMUState="true"'
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription {head}>'
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" {able}/>'
        f"<UnitDefinitions>{defined}</UnitDefinitions>"
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def _variable(fmi: int, name: str, reference: int, unit: str, causality: str, start: float | None) -> str:
    variability = "fixed" if causality == "parameter" else "continuous"
    common = f'name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"'
    value = (f' unit="{unit}"' if unit else "") + ("" if start is None else f' start="{start!r}"')
    if fmi == 3:
        return f"<Float64 {common}{value}/>"
    return f"<ScalarVariable {common}><Real{value}/></ScalarVariable>"
