"""The kinds of check this package knows, found by folder: a module that ends in ``KIND``, one a file."""

import pkgutil
from functools import cache
from importlib import import_module

from ..finding import Kind

ORDER = (
    "inertia",
    "clock",
    "jump",
    "excitation",
    "time_unit",
    "unit",
    "sign",
    "swapped",
    "geometry",
    "gravity",
    "encoder_offset",
    "saturation",
    "mixed",
)
"""Names of `checks` in results."""


@cache
def kinds() -> tuple[Kind, ...]:
    """Every kind, in the order in which they are looked at."""
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    members = [import_module(f".{name}", __name__).KIND for name in names]
    return tuple(sorted(members, key=lambda kind: ORDER.index(kind.name)))
