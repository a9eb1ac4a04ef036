"""What can be missing in a capture's model: effects, and numbers of the set-up that its file does not give."""

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...models.effect import Effect, Parameter
from ...models.effects import get_effect
from ...models.model import Model, PlacedEffect, places
from ...models.snare.setup import APPLIED, NUMBERS, SnareTree
from .handles import handle_of, key_of

Array = NDArray[np.float64]


def start_of(model: Model) -> Array:
    """Handles of the model's effects (P,) at its values; where it has none, at what hardware usually has."""
    assert isinstance(model.tree, SnareTree)
    found = []
    for p in model.effects:
        setup_has_one = APPLIED[p.effect.name].absent is None
        usual = model.tree.setup.usual(p.effect.name) if setup_has_one else handle_of(p).tries[0]
        found.append(handle_of(p).x(model.values.get(key_of(p), usual)))
    return np.array(found, float)


def absent(model: Model, placed: PlacedEffect) -> float:
    """Handle of an effect that is not there."""
    assert isinstance(model.tree, SnareTree)
    return handle_of(placed).x(model.tree.setup.usual(placed.effect.name))


def library(model: Model) -> list[PlacedEffect]:
    """Every effect of the vocabulary that this capture can have, beside those that the model has.

    Numbers of the set-up that the model file does not give are candidates too: to correct one is no missing physics.
    """
    known = {p.key for p in model.effects}
    every = [PlacedEffect(get_effect(name), at) for name in APPLIED for at in places(get_effect(name), model.tree)]
    return [p for p in every if p.key not in known] + _numbers_open(model)


def _numbers_open(model: Model) -> list[PlacedEffect]:
    assert isinstance(model.tree, SnareTree)
    setup = model.tree.setup
    target = ("mass",) if setup.target.rotates else ()  # its mass and its inertia go together
    return [PlacedEffect(_number(name), a.at) for name, a in NUMBERS.items() if name not in (*setup.given, *target)]


def _number(name: str) -> Effect:
    unit = "kg" if name == "mass" else "m"
    meaning = f"the set-up's {name.replace('_', ' ')} is not the model's"

    def law(_s: Mapping[str, ca.SX], p: Mapping[str, ca.SX]) -> ca.SX:
        return p["value"]

    value = Parameter("value", unit, name.replace("_", " "))
    return Effect(name, "set-up", "target", meaning, name, "", (value,), law, experiment="measure it")
