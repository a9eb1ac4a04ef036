"""The snare with impulses at its ports, so that a coupling conserves momentum.

A force that is read at communication points says little about what passed between them: a contact rings a thousand
times a second. What passed is known exactly, it is what the snare's own bodies gained: with P, L the momentum of cables
and floating target about the world's origin, x the effector's origin, and I, T the impulse and its moment about x,

    I = −ΔP − I_pin,      T = −ΔL − x I − x_pin × I_pin − T_pin,      x I standing for x × I,

over each macro step, added up since the start. (I_pin, T_pin) on a pin that is moved from outside is the sum of the
contact forces at the model's own steps. Momentum that leaves here thus arrives there, to rounding, whatever the step.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...models.snare.model import SnareModel
from ...models.snare.momentum import left_over, momentum
from ..participant import Variable
from .snare import SnareParticipant

_ENERGIES = ("ring_work", "ring_motor", "strain", "kinetic", "overlap", "target", "damped", "friction")


class ImpulseSnareParticipant(SnareParticipant):
    """A snare that sums up the impulses it gives: `SnareParticipant` with more outputs.

    ``impulse.effector.*`` and ``angular_impulse.effector.*`` [N·s, N·m·s] are what the snare has given the end effector
    since the start, the moment about its origin; the same of ``pin``, about its foot, where it is moved from outside.
    ``momentum.linear.*`` and ``momentum.angular.*`` are those of cables and floating target, about the world's origin,
    and ``energy.*`` [J] is what `SnareHistory` calls energies.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        """Take what `SnareParticipant` takes."""
        super().__init__(*arguments, **keywords)
        bodies = ("effector", "pin") if self._moves_target else ("effector",)
        shown = [
            (f"{kind}.{body}.{axis}", unit, f"{kind.replace('_', ' ')} on the {body} since the start, world frame")
            for body in bodies
            for kind, unit in (("impulse", "N*s"), ("angular_impulse", "N*m*s"))
            for axis in "xyz"
        ]
        for kind, unit in (("linear", "N*s"), ("angular", "N*m*s")):
            shown += [
                (f"momentum.{kind}.{axis}", unit, f"{kind} momentum of cables and floating target") for axis in "xyz"
            ]
        shown += [
            (f"energy.{name}", "J", f"{name.replace('_', ' ')}; since the start where it is lost") for name in _ENERGIES
        ]
        self.variables = (*self.variables, *(Variable(name, "output", unit, 0.0, text) for name, unit, text in shown))
        self._passed, self._momentum = np.zeros(6), np.zeros(6)

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """As `SnareParticipant.initialize`."""
        super().initialize(time, parameters)
        self._passed, self._momentum = np.zeros(6), np.zeros(6)

    def step(self, time: float, size: float) -> None:
        """Step, and sum the impulses."""
        model = self._built()
        before, pin, foot = self._momentum, model.pin_impulse(), model.assembly.pin[0].copy()
        effector = model.effector_pose().position
        super().step(time, size)
        effector = 0.5 * (effector + model.effector_pose().position) - model.origin
        foot = 0.5 * (foot + model.assembly.pin[0])
        on_pin = model.pin_impulse() - pin if self._moves_target else np.zeros(6)
        self._momentum = momentum(model.assembly)
        self._passed = self._passed + left_over(self._momentum - before, effector, foot, on_pin)

    def _built(self) -> SnareModel:
        if self._model is not None:
            return self._model
        model = super()._built()
        self._momentum = momentum(model.assembly)
        return model

    def outputs(self) -> np.ndarray:
        """What `SnareParticipant` shows, then impulses, momentum and energies."""
        model = self._built()
        passed = [self._passed, model.pin_impulse()] if self._moves_target else [self._passed]
        total = self._momentum.copy()
        total[3:] += np.cross(model.origin, total[:3])
        return np.concatenate([super().outputs(), *passed, total, list(model.energies().values())])

    def cables(self) -> np.ndarray:
        """Where the cables' nodes are now, in the world [m]; (3, n_nodes, 3)."""
        model = self._built()
        a = model.assembly
        moved = a.system.systemData.GetODE2Coordinates()[: a.n_cable_coordinates].reshape(a.nodes.shape)
        return (moved + a.nodes)[:, :, 0] + model.origin

    def tension(self) -> float:
        """Largest force of a cable on its ring now [N]."""
        assembly = self._built().assembly
        data = assembly.system.systemData
        ends = np.reshape(data.GetAECoordinates()[data.GetObjectLTGAE(assembly.ends_object)], (6, 3))
        return float(np.linalg.norm(ends, axis=1).max())

    def save(self) -> Any:
        """The model's state, the inputs, and the sums."""
        return super().save(), self._passed, self._momentum

    def restore(self, state: Any) -> None:
        """Back to a saved state, bit for bit."""
        own, passed, total = state
        super().restore(own)  # which may build the model anew
        self._passed, self._momentum = passed, total
