"""The effects this package knows, found by folder.

A module here whose name does not start with an underscore is a member and ends in ``EFFECT``. A new effect is a new
file; nothing else lists it.
"""

import pkgutil
from functools import cache
from importlib import import_module

from ...errors import InputError, nearest
from ..effect import Effect, term

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

MOST_TERMS = 9
"""Terms of a series at one place."""


@cache
def _members() -> tuple[Effect, ...]:
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    members = [import_module(f".{name}", __name__).EFFECT for name in names]
    return tuple(sorted(members, key=lambda effect: (FAMILIES.index(effect.family), effect.name)))


def effects() -> dict[str, Effect]:
    """Every known effect by name, in the order of the vocabulary's families and then by name."""
    return {effect.name: effect for effect in _members()}


def get_effect(name: str) -> Effect:
    """The effect of that name; ``name_2`` and so on are further terms of one that is a series.

    Raises
    ------
    InputError
        If there is none: with the nearest name and all known ones.
    """
    known = effects()
    if name in known:
        return known[name]
    first, number = term_of(name)
    if number > 1:
        return term(known[first], number)
    near = nearest(name, known, 0.5)
    hint = f" (nearest: {near})" if near else ""
    raise InputError(f"unknown effect '{name}'{hint}; known effects: {', '.join(known)}")


def term_of(name: str) -> tuple[str, int]:
    """The vocabulary's word for an effect, and which term of a series it is, from 1: of ``torque_ripple_2`` the second
    of ``torque_ripple``. Any other name is its own word."""
    first, _, number = name.rpartition("_")
    known = effects()
    if name not in known and first in known and known[first].series and number in map(str, range(2, MOST_TERMS + 1)):
        return first, int(number)
    return name, 1
