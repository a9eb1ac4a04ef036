"""A capture's model file as a participant: its snare and target, and its effects under the vocabulary's names."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ...models.effects import get_effect
from ...models.snare.parameters import SnareParameters
from ...models.snare.setup import APPLIED, SetupField
from ...models.snare.target import Target
from ..participant import Variable
from .snare import SnareParticipant


class SnareModelParticipant(SnareParticipant):
    """A capture as a model file has it: the end effector moved by others, snare, target and effects the file's.

    As `SnareParticipant`; an effect's parameter is called ``effect.place.parameter``, in place of the field that it
    sets.

    Parameters
    ----------
    parameters, target : mapping
        Fields of `SnareParameters` and `Target`, the effects' values among them.
    effects : sequence of str
        Names of the effects.
    """

    def __init__(
        self, parameters: Mapping[str, Any], target: Mapping[str, Any], effects: Sequence[str], name: str = "snare"
    ) -> None:
        """Describe the variables; the model is built at the first step."""
        super().__init__(SnareParameters(**parameters), Target(**target), name=name)
        self._own_target = self._target
        self._effects = {f"{e}.{APPLIED[e].at}.{APPLIED[e].parameter}": (e, APPLIED[e]) for e in effects}
        taken = {a.field for _, a in self._effects.values()}
        self.variables = (
            *(self._parameter(key, effect, a) for key, (effect, a) in self._effects.items()),
            *(v for v in self.variables if not (v.causality == "parameter" and v.name in taken)),
        )

    def _parameter(self, key: str, effect: str, a: SetupField) -> Variable:
        (p,) = get_effect(effect).parameters
        value = getattr(self._own_target if a.of_target else self._default, a.field)
        words = f"{p.meaning}: {get_effect(effect).sentence}"
        return Variable(key, "parameter", p.unit, float(value), words, p.low, p.high)

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """As `SnareParticipant.initialize`."""
        snare, target = {}, {}
        for key, value in (parameters or {}).items():
            a = self._effects[key][1] if key in self._effects else None
            (target if a and a.of_target else snare)[a.field if a else key] = float(value)
        self._target = replace(self._own_target, **target)
        super().initialize(time, snare)
