"""What can be missing in a capture's model: effects, and numbers of the set-up that its file does not give."""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..models.effect import Effect, Parameter
from ..models.effects import get_effect
from ..models.model import Model, Placed, places
from ..models.snare.setup import APPLIED, NUMBERS, SnareTree
from .snare_fit import HANDLES, key_of

Array = NDArray[np.float64]


def start_of(model: Model, placed: Sequence[Placed]) -> Array:
    """Handles of effects at the model's values; where it has none, at what hardware usually has."""
    assert isinstance(model.tree, SnareTree)
    found = []
    for p in placed:
        handle, a = HANDLES[p.effect.name], APPLIED[p.effect.name]
        usual = model.tree.setup.usual(p.effect.name) if a.absent is None else handle.tries[0]
        found.append(handle.x(model.values.get(key_of(p), usual)))
    return np.array(found, float)


def absent(model: Model, placed: Placed) -> float:
    """Handle of an effect that is not there."""
    assert isinstance(model.tree, SnareTree)
    return HANDLES[placed.effect.name].x(model.tree.setup.usual(placed.effect.name))


def library(model: Model) -> list[Placed]:
    """Every effect of the vocabulary that this capture can have, beside those that the model has."""
    known = {p.key for p in model.effects}
    every = [Placed(get_effect(name), at) for name in APPLIED for at in places(get_effect(name), model.tree)]
    return [p for p in every if p.key not in known] + numbers_open(model)


def numbers_open(model: Model) -> list[Placed]:
    """Numbers of the set-up that the model file does not give, as candidates: to correct one is no missing physics."""
    assert isinstance(model.tree, SnareTree)
    setup = model.tree.setup
    target = ("mass",) if setup.target.rotates else ()  # its mass and its inertia go together
    return [Placed(_number(name), a.at) for name, a in NUMBERS.items() if name not in (*setup.given, *target)]


def _number(name: str) -> Effect:
    unit = "kg" if name == "mass" else "m"
    meaning = f"the set-up's {name.replace('_', ' ')} is not the model's"

    def law(_s: Mapping[str, ca.SX], p: Mapping[str, ca.SX]) -> ca.SX:
        return p["value"]

    value = Parameter("value", unit, name.replace("_", " "))
    return Effect(name, "set-up", "target", meaning, name, "", (value,), law, experiment="measure it")
