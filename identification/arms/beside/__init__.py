"""What stands beside every explanation of an arm's torques, one file each, found by folder.

A module here whose name does not start with an underscore ends in a function ``blocks(context)``: columns that may be
in the residual whatever is missing, in units of their prior deviation. A new nuisance is a new file; nothing else lists
it.
"""

import pkgutil
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from typing import Protocol

from ._block import FitContext, NuisanceBlock


class Nuisance(Protocol):
    """What a module of this folder ends in."""

    def __call__(self, context: FitContext) -> Iterable[NuisanceBlock]:
        """Its columns under a fit; none where it has nothing to say."""
        ...


@cache
def nuisances() -> tuple[Nuisance, ...]:
    """Every nuisance, by name."""
    names = [m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")]
    return tuple(import_module(f".{name}", __name__).blocks for name in sorted(names))
