"""Places of effects that only a suspension rig has: slings, slides, booms, all slings together.

Letters: n samples, J joints, m numbers that a law gives, p parameters of an effect.
"""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from ...models.hidden_state import LawEvaluation, rows
from ...models.rig.kinematics import boom_map, place_map, reached_joints, sling_of
from ...models.rig.points import point_motion
from ...models.rig.rig import Rig
from .effect_places import ChannelTerm, EffectPlace, JointPlace, TorqueState
from .experiment import Experiment

Array = NDArray[np.float64]

PLACES = ("sling", "slide", "boom", "suspension")
"""Kinds of place that only a rig has."""


class RigPlace(EffectPlace):
    """A place of a rig; the rig's geometry gives the torque of its law at every joint."""

    @property
    def rig(self) -> Rig:
        """The tree, which is a rig's wherever such a place is."""
        return cast(Rig, self.tree)

    def reach(self, experiment: Experiment) -> Array:
        """Drive torque per number that the law gives (n, J, m)."""
        kind, at = self.placed.effect.at, self.placed.at
        key = (kind, at)
        if key not in experiment.store:
            # One joint's samples side by side: they are used joint by joint.
            experiment.store[key] = np.asfortranarray(place_map(self.rig, kind, at, experiment.motion.q))
        return experiment.store[key]

    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """Through `reach`."""
        reach, used = self.reach(experiment), list(rows(self.placed.effect))
        terms = []
        for c in reached_joints(self.rig, self.placed.effect.at, self.placed.at, rows(self.placed.effect)):
            torque, columns = np.zeros(len(values)), np.zeros((len(values), by_parameter.shape[2]))
            for m in used:
                torque += reach[:, c, m] * values[:, m]
                columns += reach[:, c, m, None] * by_parameter[:, m]
            terms.append((c, torque, columns))
        return terms


class SlingPlace(RigPlace):
    """A sling: a wrench on the arm at its hang point (m = 6)."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """The hang point's velocity (n, 3) [m/s], the weight and tension that the sling carries [N], and time [s]."""
        experiment, sling, n = along.experiment, sling_of(self.rig, self.placed.at), len(along.experiment.motion.time)
        motion, key = experiment.motion, ("velocity", self.placed.at)
        if key not in experiment.store:
            found = point_motion(self.rig, sling.link, sling.point, motion.q, motion.qd)
            experiment.store[key] = found.velocity
        carried = {"weight": np.full(n, sling.weight), "tension": np.full(n, sling.tension)}
        return {"velocity": experiment.store[key], **carried, "time": experiment.elapsed}


class BoomPlace(RigPlace):
    """A boom, a link that bends and twists: upward force per lever on the slings beyond it (m = 2)."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """Sum of squared levers of the slings beyond it, for torsion and bending (n, 2) [m²], and time [s]."""
        return {"spread": self._geometry(along.experiment)[1], "time": along.experiment.elapsed}

    def reach(self, experiment: Experiment) -> Array:
        """Drive torque per force and lever (n, J, 2)."""
        return self._geometry(experiment)[0]

    def _geometry(self, experiment: Experiment) -> tuple[Array, Array]:
        """Reach (n, J, 2) and spread (n, 2)."""
        keys = ("boom", self.placed.at), ("spread", self.placed.at)
        if keys[0] not in experiment.store:
            link = [link.name for link in self.rig.links].index(self.placed.at)
            experiment.store.update(zip(keys, boom_map(self.rig, link, experiment.motion.q), strict=True))
        return experiment.store[keys[0]], experiment.store[keys[1]]


class SuspensionPlace(RigPlace):
    """All slings together: a force per rise of each one's hang point (m = 1)."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """Time [s]."""
        return {"time": along.experiment.elapsed}


class SlidePlace(RigPlace, JointPlace):
    """The slides that a joint moves: a friction force at them (m = 1), by a law that reads the joint."""

    def by_load(self, law: LawEvaluation) -> Array | None:
        """None: the joint's load is no force on the slides."""
        return None
