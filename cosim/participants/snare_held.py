"""The snare for masters that hold every input over a step and exchange all outputs at once (Jacobi), as Ecos does.

Held inputs make such a coupling of first order: 0.4 mm after 10 s of the inspection capture, at steps of 1 ms.
What a better master does between the participants, this one does inside, with the last three values (`hold`): what
moves it goes on along a parabola, and what it gives the others is not the force of now but the mean force that the
impulses' parabola gives the step to come, plus what the last step's guess fell short of. The impulse is thus handed
over whole, one step late where a guess was wrong.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..hold import HOLDS, combine, end_weights, weights
from ..participant import Variable
from .snare_impulses import ImpulseSnareParticipant

_POINTS = 3


class HeldSnareParticipant(ImpulseSnareParticipant):
    """A snare whose inputs are held over each step, and whose ``held_force`` is to be held over the next.

    As `ImpulseSnareParticipant`, with outputs ``held_force.effector.*`` and ``held_torque.effector.*`` [N, N·m], and
    the same of a ``pin`` that is moved from outside. Steps of one size follow each other.
    """

    input_order = 0

    def __init__(self, *arguments: Any, **keywords: Any) -> None:
        """Take what `SnareParticipant` takes."""
        super().__init__(*arguments, **keywords)
        bodies = ("effector", "pin") if self._moves_target else ("effector",)
        self.variables += tuple(
            Variable(
                f"held_{kind}.{body}.{axis}", "output", unit, 0.0, f"mean over the next step, on the {body}, {axis}"
            )
            for body in bodies
            for kind, unit in (("force", "N"), ("torque", "N*m"))
            for axis in "xyz"
        )
        self._forget(0.0)

    def _forget(self, time: float) -> None:
        """No past: impulses start at zero, and nothing is known of what moves the snare."""
        zero = np.zeros(12 if self._moves_target else 6)
        self._moved: list[tuple[float, np.ndarray]] = []
        self._given_impulses: list[tuple[float, np.ndarray]] = [(time, zero)]
        self._handed, self._held = zero, zero

    def initialize(self, time: float = 0.0, parameters: Mapping[str, float] | None = None) -> None:
        """As `SnareParticipant.initialize`."""
        super().initialize(time, parameters)
        self._forget(time)

    def step(self, time: float, size: float) -> None:
        """Follow the inputs' parabola for a step, and predict the outputs of the next one."""
        moved = [(time, self._inputs.copy()), *self._moved][:_POINTS]
        if len(moved) > 1:
            nodes = tuple((t - time) / size for t, _ in moved)
            rows = weights(HOLDS["quadratic"], nodes, size, 2)[1:]
            found = [combine(row, [values for _, values in moved]) for row in rows]
            self.set_input_derivatives(found[0], found[1] if len(found) > 1 else np.zeros_like(found[0]))
        super().step(time, size)
        end, passed = time + size, self._impulses()
        known = [(end, passed), *self._given_impulses][:_POINTS]
        nodes = tuple((t - end) / size for t, _ in known)
        ahead = combine(end_weights(nodes), [values for _, values in known])
        self._moved, self._given_impulses = moved, known
        self._held, self._handed = (ahead - self._handed) / size, ahead

    def _impulses(self) -> np.ndarray:
        """What the snare has given since the start, on the end effector and a moved pin."""
        own = self._passed.copy()
        return np.concatenate([own, self._built().pin_impulse()]) if self._moves_target else own

    def outputs(self) -> np.ndarray:
        """What `ImpulseSnareParticipant` shows, then what is to be held."""
        return np.concatenate([super().outputs(), self._held])

    def save(self) -> Any:
        """The snare's state, and the last values."""
        return super().save(), list(self._moved), list(self._given_impulses), self._handed, self._held

    def restore(self, state: Any) -> None:
        """Back to a saved state, bit for bit."""
        own, moved, given, self._handed, self._held = state
        super().restore(own)
        self._moved, self._given_impulses = list(moved), list(given)
