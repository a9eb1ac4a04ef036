"""A beam, a link that twists and bends, as a place of effects: what it transmits, and what the joints feel of it."""

import numpy as np
from numpy.typing import NDArray

from ...models.beam import BeamTerms, beam_terms
from ...models.hidden_state import rows
from .effect_places import ChannelTerm, EffectPlace, TorqueState
from .experiment import Experiment

Array = NDArray[np.float64]


class BeamPlace(EffectPlace):
    """A link's far end: its turns about three axes, their rates and accelerations (m = 9), to first order."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """Moment (n, 3), inertia beyond (n, 9), both at the nominal masses, and time."""
        here = self._terms(along.experiment)
        n = len(here.moment)
        return {
            "moment": here.moment,
            "inertia_beyond": here.inertia.reshape(n, -1),
            "time": along.experiment.elapsed,
        }

    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """The far end's motion changes every channel that feels it by the rigid body's derivative."""
        here, used = self._terms(experiment), list(rows(self.placed.effect))
        path = np.concatenate([here.by_turn, here.by_rate, here.by_acceleration], axis=2)[:, :, used]
        values, by_parameter = values[:, used], by_parameter[:, used]
        return [
            (
                int(c),
                np.einsum("nm,nm->n", path[:, c], values),
                np.einsum("nm,nmp->np", path[:, c], by_parameter),
            )
            for c in self.tree.coupled(self.joint)
        ]

    def _terms(self, experiment: Experiment) -> BeamTerms:
        """Worked out once for a recording, whatever of it is bridged."""
        whole, key = experiment.whole or experiment, ("beam", self.placed.at)
        if key not in whole.store:
            motion = whole.motion
            whole.store[key] = beam_terms(self.tree, self.joint, motion.q, motion.qd, motion.qdd)
        return whole.store[key]
