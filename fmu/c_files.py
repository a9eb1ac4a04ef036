"""Source files of an FMU: the model's own, generated, and ours and FMI's, copied."""

import hashlib
import math
from importlib.resources import files
from typing import Any

import casadi as ca

from ..extras import needed_for
from .equations import Equations, ModelVariable

_OURS = ("instance.h", "instance.c", "calls.c")
_OF_EQUATIONS = ("equations.h", "equations.c", "rosenbrock.c")
_OF_HOSTED = ("hosted.h", "hosted.c")
_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}


def source_files(equations: Equations, version: int) -> tuple[dict[str, str], str]:
    """Text of every source file by name, and the token that ties binary and model description together."""
    generated = _generated(equations)
    shapes = {
        "HOSTED": 0,
        "FOLLOWS": int(equations.follows),
        "STIFF": int(equations.stiff),
        "N_STATES": equations.n_states,
        "WORK_SIZE": max(f.sz_w() for f in equations.functions.values()),
    }
    found = model_header(equations.variables, shapes, generated)
    copied = _copied(version, _OURS + _OF_EQUATIONS)
    return {"model.h": found[0], "generated.c": generated, **copied}, found[1]


def hosted_files(variables: tuple[ModelVariable, ...], version: int, config: str) -> tuple[dict[str, str], str]:
    """As `source_files`, for a model that runs in a Python process of its own."""
    header, token = model_header(variables, {"HOSTED": 1}, config)
    return {"model.h": header, **_copied(version, _OURS + _OF_HOSTED)}, token


def model_header(variables: tuple[ModelVariable, ...], shapes: dict[str, int], content: str) -> tuple[str, str]:
    """Text of model.h, and the token: a digest of the variables and of ``content``."""
    groups = {c: [v for v in variables if v.causality == c] for c in ("input", "parameter", "output")}
    digest = hashlib.sha256("\0".join([repr(variables), repr(shapes), content]).encode()).hexdigest()
    token = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    names = ", ".join(f'"{name}"' for name in ("time", *(v.name for c in groups.values() for v in c)))
    given = groups["parameter"]
    least = [v.minimum if v.refuses else -math.inf for v in given]
    most = [v.maximum if v.refuses else math.inf for v in given]
    lines = [
        "/* Written at export. */",
        "#include <math.h>",
        f'#define MODEL_TOKEN "{token}"',
        *(f"#define {name} {value}" for name, value in shapes.items()),
        *(f"#define N_{causality.upper()}S {len(members)}" for causality, members in groups.items()),
        f"static const double START_INPUT[] = {{{_numbers([v.start for v in groups['input']])}}};",
        f"static const double START_PARAMETER[] = {{{_numbers([v.start for v in groups['parameter']])}}};",
        f"static const double LEAST_PARAMETER[] = {{{_numbers(least)}}};",
        f"static const double MOST_PARAMETER[] = {{{_numbers(most)}}};",
        "static const char FIXED_PARAMETER[] = {"
        + ", ".join(str(int(v.fixed)) for v in groups["parameter"])
        + (", 0};" if groups["parameter"] else "0};"),
        f"static const char *const VARIABLE_NAME[] = {{{names}}};",
    ]
    return "\n".join(lines) + "\n", token


def _numbers(values: list[float]) -> str:
    """C's spelling of numbers, with one zero more: an array in C has at least one element."""
    spelled = {math.inf: "INFINITY", -math.inf: "-INFINITY"}
    return ", ".join([*(spelled.get(value) or repr(float(value)) for value in values), "0.0"])


def _generated(equations: Equations) -> str:
    generator = ca.CodeGenerator("generated.c", {"casadi_int": "long long int"})
    for function in equations.functions.values():
        if function.sz_iw():
            raise AssertionError(f"{function.name()} needs integer work space, which the wrapper does not give")
        generator.add(function)
    text: Any = generator.dump()
    # static: no symbol of one model can stand in for another's
    return f"#define CASADI_SYMBOL_EXPORT static\n{text}"


def _copied(version: int, ours: tuple[str, ...]) -> dict[str, str]:
    folder = files("snarelab.fmu") / "c"
    texts = {name: (folder / name).read_text(encoding="utf-8") for name in (*ours, f"fmi{version}.c")}
    with needed_for("an export, for FMI's headers,"):
        headers = files("fmpy") / "c-code"
    return texts | {name: (headers / name).read_text(encoding="utf-8") for name in _HEADERS[version]}
