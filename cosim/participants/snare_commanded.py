"""The snare under a control program: its ring turns at a commanded rate."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...models.snare.commanded_ring import CommandedRing, ring_torque
from ..participant import Variable
from .snare_impulses import ImpulseSnareParticipant


class CommandedSnareParticipant(ImpulseSnareParticipant):
    """`ImpulseSnareParticipant` with an input ``rate.ring`` [rad/s], positive as the ring closes.

    Further outputs: ``torque.ring`` [N·m] of the cables on the rotating ring, ``tension`` [N], the largest force of a
    cable on its ring, and ``touching``, the number of contacts with the pin.
    """

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        """Take what `ImpulseSnareParticipant` takes."""
        super().__init__(*arguments, **keywords)
        self.variables = (
            *self.variables,
            Variable("rate.ring", "input", "rad/s", 0.0, "rate at which the ring is to turn, positive as it closes"),
            Variable("torque.ring", "output", "N*m", 0.0, "torque of the cables on the rotating ring"),
            Variable("tension", "output", "N", 0.0, "largest force of a cable on its ring"),
            Variable("touching", "output", "1", 0.0, "contacts of cables and pin", discrete=True),
        )
        self._ring = CommandedRing(self._default.ring_ramp)
        self._drive = self._ring
        self._asked = 0.0

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """As `ImpulseSnareParticipant.initialize`; the ring stands open."""
        super().initialize(time, parameters)
        self._ring.ramp, self._ring.state, self._asked = self._given.ring_ramp, (time, 0.0, 0.0, 0.0), 0.0

    def set_inputs(self, values: np.ndarray) -> None:
        """Take poses and twists, and the ring's rate."""
        super().set_inputs(values[:-1])
        self._asked = float(values[-1])

    def set_input_derivatives(self, first: np.ndarray, second: np.ndarray) -> None:
        """Of poses and twists; the ring's rate is held."""
        super().set_input_derivatives(first[:-1], second[:-1])

    def step(self, time: float, size: float) -> None:
        """Step with the ring at its commanded rate."""
        self._built()  # which looks at where the ring stands
        self._ring.command(time, self._asked)
        super().step(time, size)

    def outputs(self) -> np.ndarray:
        """What `ImpulseSnareParticipant` shows, then torque, tension and contacts."""
        model = self._built()
        a, data = model.assembly, model.assembly.system.systemData
        ends = np.reshape(data.GetAECoordinates()[data.GetObjectLTGAE(a.ends_object)], (6, 3))
        torque = ring_torque(ends, a.ends, a.frame)
        tension = float(np.linalg.norm(ends, axis=1).max())
        return np.concatenate([super().outputs(), [torque, tension, float(model.n_contacts)]])

    def save(self) -> Any:
        """The snare's state, and the ring's."""
        return super().save(), self._ring.state, self._asked

    def restore(self, state: Any) -> None:
        """Back to a saved state, bit for bit."""
        own, ring, asked = state
        self._ring.state = (ring[0], 0.0, 0.0, 0.0) if self._model is None else ring
        super().restore(own)  # which may build the model anew, with the ring open
        self._ring.state, self._asked = ring, asked
        self._built().assembly.lift()
