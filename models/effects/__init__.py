"""The effects this package knows, found by folder.

A module here whose name does not start with an underscore is a member and ends in ``EFFECT``. A new effect is a new
file; nothing else lists it.
"""

import pkgutil
from functools import cache
from importlib import import_module

from ...errors import InputError, nearest
from ..effect import Effect

FAMILIES = (
    "joint friction",
    "drive train",
    "structure and mass",
    "suspension rig",
    "free-floating base",
    "snare and contact",
    "docking",
    "measurement",
)


@cache
def _members() -> tuple[Effect, ...]:
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    members = [import_module(f".{name}", __name__).EFFECT for name in names]
    return tuple(sorted(members, key=lambda effect: (FAMILIES.index(effect.family), effect.name)))


def effects() -> dict[str, Effect]:
    """Every known effect by name, in the order of the vocabulary's families and then by name."""
    return {effect.name: effect for effect in _members()}


def get_effect(name: str) -> Effect:
    """The effect of that name.

    Raises
    ------
    InputError
        If there is none: with the nearest name and all known ones.
    """
    known = effects()
    if name in known:
        return known[name]
    near = nearest(name, known, 0.5)
    hint = f" (nearest: {near})" if near else ""
    raise InputError(f"unknown effect '{name}'{hint}; known effects: {', '.join(known)}")
