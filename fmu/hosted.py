"""FMUs of participants that need Python: an Exudyn snare, a Drake plant.

The FMU's library is ours, in C, and starts a Python process for each instance (``host.py``, in the FMU's resources).
The exporters `pythonfmu` and `pythonfmu3` load the interpreter into the importer instead, which makes two FMUs share
one set of modules, needs libpython where the importer looks for it, and lets a failing import end the importer.

This module knows participants by name only, and imports their package when it looks for one: FMUs stand beside the
co-simulation, not on it.
"""

import inspect
import json
import re
import sys
from functools import cache
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from ..errors import InputError
from .build import pack
from .c_files import hosted_files
from .description import ModelInfo
from .equations import ModelVariable

_PARTICIPANTS = "snarelab.cosim.participants"


@cache
def _participants() -> dict[str, type]:
    """Participants that can be built without arguments, by name: the class's without "Participant", in snake_case."""
    base = import_module("snarelab.cosim.participant").Participant
    found = {}
    for module in iter_modules(import_module(_PARTICIPANTS).__path__):
        if module.name.startswith("_"):
            continue
        try:
            members = vars(import_module(f"{_PARTICIPANTS}.{module.name}")).values()
        except ImportError:
            continue  # its engine is not installed: it cannot be exported here
        for cls in members:
            own = inspect.isclass(cls) and issubclass(cls, base) and cls.__module__ == f"{_PARTICIPANTS}.{module.name}"
            if own and not cls.__name__.startswith("_") and not _demands(cls):
                name = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__.removesuffix("Participant")).lower()
                found[name] = cls
    return found


def _demands(cls: type) -> bool:
    """Whether a class needs arguments."""
    parameters = list(inspect.signature(cls).parameters.values())
    return any(p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD) for p in parameters)


def participant_names() -> list[str]:
    """Participants that can be exported by name."""
    return list(_participants())


def participant_class(name: str) -> type:
    """The class behind one of `participant_names`."""
    return _participants()[name]


def capture_class() -> type:
    """The participant that a capture's model file becomes."""
    return import_module(f"{_PARTICIPANTS}.snare_model").SnareModelParticipant


def write_hosted(name: str, path: str | Path, version: int) -> Path:
    """Write the FMU of a participant by name.

    Raises
    ------
    InputError
        No C compiler, a system without Unix sockets, or a place that cannot be written.
    """
    return write_hosted_class(participant_class(name), {}, path, version, name)


def write_hosted_class(cls: type, arguments: dict[str, Any], path: str | Path, version: int, name: str) -> Path:
    """Write the FMU of any participant class.

    Parameters
    ----------
    cls : type
        A subclass of `snarelab.cosim.participant.Participant`, importable by its module's name.
    arguments : dict
        What it is built with; JSON's types.
    path : path
    version : 2 or 3
    name : str
        A C identifier.
    """
    if not sys.platform.startswith("linux"):
        raise InputError(f"{name}: FMUs with Python inside are built on Linux only; export it there")
    participant = cls(**arguments)
    variables = tuple(
        ModelVariable(
            v.name,
            v.causality,
            v.unit,
            v.start,
            v.description.replace("`", ""),
            v.minimum,
            v.maximum,
            fixed=v.causality == "parameter",
            depends=v.depends,
        )
        for v in sorted(participant.variables, key=lambda v: ("input", "parameter", "output").index(v.causality))
    )
    saves, interpolates = participant.can_restore, participant.input_order > 0
    module = sys.modules[cls.__module__]
    source = Path(str(module.__file__)).resolve()
    config: dict[str, Any] = {
        "module": cls.__module__,
        "class": cls.__qualname__,
        "arguments": arguments,
        "path": [str(source.parents[cls.__module__.count(".")]), str(Path(str(files("snarelab"))).parent)],
        **{c: [v.name for v in variables if v.causality == c] for c in ("input", "parameter", "output")},
    }
    participant.close()
    sources, token = hosted_files(variables, version, json.dumps(config))
    description = " ".join((inspect.getdoc(cls) or name).split("\n\n")[0].replace("`", "").split())
    about = ModelInfo(
        name=name,
        identifier=name,
        description=description,
        token=token,
        step=1e-3,
        stop=10.0,
        derivatives=False,
        interpolates=interpolates,
        needs_tool=True,
        saves=saves,
        compiled_from=f"fmi{version}.c",
    )
    resources = {
        "host.json": json.dumps({"token": token, **config}, indent=1),
        "host.py": (files("snarelab.fmu") / "host.py").read_text(encoding="utf-8"),
        "warden.py": (files("snarelab") / "warden.py").read_text(encoding="utf-8"),
        "python.txt": sys.executable + "\n",
    }
    return pack(about, variables, sources, resources, path, version)
