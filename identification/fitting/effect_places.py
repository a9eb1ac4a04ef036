"""Places of effects on any arm: the signals that a law reads there, and the law's terms of the torque channels.

Letters: n samples, J joints, m numbers that a law gives, p parameters of an effect. Places that only a suspension rig
has are in `rig_places`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...models.axes import Place, place
from ...models.hidden_state import LawEvaluation, evaluate_law, rows
from ...models.model import PlacedEffect
from ...models.rig.points import far_end
from ...models.tree import Tree
from .effect_law import BACKWARD, FORWARD, law_along, passing
from .experiment import Experiment
from .floating_terms import base_signals

Array = NDArray[np.float64]

ChannelTerm = tuple[int, Array, Array]
"""A channel, what is added to it (n,) [N·m or N], and its derivative by the effect's parameters (n, p)."""


class TorqueState(NamedTuple):
    """A recording with the torque that has been modelled so far, each (n, J) [N·m or N]."""

    experiment: Experiment
    load: Array
    """Of the rigid body."""
    reading: Array
    """What sensors are given."""


class EffectTerms(NamedTuple):
    """Terms of one placed effect in the torque channels."""

    terms: list[ChannelTerm]
    by_load: Array | None = None
    """Derivative of the torque at the place by the load there (n,); None where the law does not read the load."""
    passed: Callable[[Array], Array] | None = None
    """Of a sensor: what it makes of columns (n, k) of its channel."""


@dataclass(frozen=True, eq=False)
class EffectPlace(ABC):
    """Where one effect acts.

    Parameters
    ----------
    tree : Tree
    placed : PlacedEffect
    joint : int
        Index of the joint, or of the link, that the place belongs to; of an axis, the first joint.
    speed_scale : float
        Peak speed in the training recordings that the law refers to [rad/s or m/s].
    """

    tree: Tree
    placed: PlacedEffect
    joint: int
    speed_scale: float

    apart: ClassVar[bool] = False
    """Whether a sensor works out its share of the rigid body's torque from the motion, apart from the load."""

    @abstractmethod
    def signals(self, along: TorqueState) -> dict[str, Array]:
        """What the law reads, each (n,) or (n, size), SI units."""

    @abstractmethod
    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """Terms of the torque channels from the law's values (n, m) and their derivative (n, m, p)."""

    def terms(self, along: TorqueState, parameters: Array, bare: bool = False) -> EffectTerms:
        """The effect's terms at these parameters (p,); ``bare`` as of `law_along`."""
        law = law_along(along.experiment, self.placed.effect, self.signals(along), parameters, bare)
        return EffectTerms(self.spread(along.experiment, law.values, law.by_parameter), self.by_load(law))

    def by_load(self, law: LawEvaluation) -> Array | None:
        """Derivative of the torque at the place by its load (n,); None where the law does not depend on the load."""
        return None

    def masses(self, parameters: Array) -> Array | None:
        """Mass that a unit of each parameter adds to the arm (p,) [kg]; None where the law changes no link."""
        return None

    def once_more(self, parameters: Array) -> Array | None:
        """Changes of the parameters (p,) that double what the model has at the place; None where none do."""
        return None


class JointPlace(EffectPlace):
    """A joint, or an axis: a torque along it, or a change of its position, rate and acceleration (m = 3)."""

    @property
    def where(self) -> Place:
        """The joint or axis."""
        return place(self.tree, self.placed.at)

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """Motion and load of the joint or axis, its channel's reading, and the motion of the effect's other joints."""
        experiment, here, effect = along.experiment, self.where, self.placed.effect
        motion = experiment.motion
        found = {
            "q": here.coordinate(motion.q),
            "qd": here.coordinate(motion.qd),
            "qdd": here.coordinate(motion.qdd),
            "load": here.load(along.load),
            "value": along.reading[:, self.joint],
            "time": experiment.elapsed,
            "temperature": motion.temperature[:, self.joint],
            "speed_scale": np.full(len(along.load), self.speed_scale),
        }
        names = [j.name for j in self.tree.joints]
        for k, other in enumerate(effect.others, 1):
            i = names.index(other)
            found |= {f"q_of_{k}": motion.q[:, i], f"qd_of_{k}": motion.qd[:, i]}
        if effect.states and effect.at != "sensor":
            found["inertia"] = here.inertia(experiment.mass_matrix)
        return found

    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """A torque acts by virtual work; a change of motion changes every channel by the rigid body's derivative."""
        if self.placed.effect.acts_on != "torque":
            return self.moved(experiment, values, by_parameter)
        here, torque, columns = self.where, values[:, 0], by_parameter[:, 0]
        if here.alone is not None:
            return [(here.alone, torque, columns)]
        return [(int(c), here.along[c] * torque, here.along[c] * columns) for c in here.channels]

    def moved(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """Terms of every channel that feels it by a change of the joint's position, rate and acceleration (n, 3), to
        first order. ``by_parameter`` (n, 3, p) is the change's derivative."""
        by_position, by_rate = experiment.tangent
        terms = []
        for c in self.tree.coupled(self.joint):
            path = np.stack([x[:, c, self.joint] for x in (by_position, by_rate, experiment.mass_matrix)], 1)
            terms.append((int(c), np.einsum("nd,nd->n", path, values), np.einsum("nd,ndp->np", path, by_parameter)))
        return terms

    def by_load(self, law: LawEvaluation) -> Array | None:
        """Of a torque, the derivative that the law gives."""
        if self.placed.effect.acts_on != "torque" or law.by_signal is None:
            return None
        return law.by_signal[:, 0, 0]


class SensorPlace(JointPlace):
    """A torque sensor, or a command; or the encoder of a single joint, which makes its own channel early alone."""

    @property
    def where(self) -> Place:
        """The joint whose channel is read."""
        return place(self.tree, self.tree.joints[self.joint].name)

    @property
    def direction(self) -> slice:
        """Against a late encoder's motion, all that the joint's motion causes is early: time in reverse. So is what
        leads."""
        return BACKWARD if self.placed.effect.leads or self.placed.at.startswith("q.") else FORWARD

    def terms(self, along: TorqueState, parameters: Array, bare: bool = False) -> EffectTerms:
        """The reading's error, and the map of its channel's columns through the sensor."""
        signals = self.signals(along)
        change, by, by_value = self.error(along, signals, signals["value"], parameters, bare)
        return self._told(along, [(self.joint, change, by)], parameters, by_value)

    def error(
        self, along: TorqueState, signals: dict[str, Array], value: Array, parameters: Array, bare: bool
    ) -> tuple[Array, Array, Array | None]:
        """Reading minus true ``value`` (n,), its derivative by parameters (n, p) and the law's by value (n, 1, 1)."""
        inputs, effect = signals | {"value": value}, self.placed.effect
        law = law_along(along.experiment, effect, inputs, parameters, bare, self.direction)
        return law.values[:, 0] - value, law.by_parameter[:, 0], law.by_signal

    def _told(
        self, along: TorqueState, terms: list[ChannelTerm], parameters: Array, by_value: Array | None
    ) -> EffectTerms:
        passed = passing(along.experiment, self.placed.effect, parameters, by_value, self.direction)
        return EffectTerms(terms, None, passed)


class EncoderPlace(SensorPlace):
    """An encoder of a joint among others: its error changes every channel by the rigid body's derivative.

    The part of its own channel beside the rigid body's load is early as well."""

    apart = True

    def terms(self, along: TorqueState, parameters: Array, bare: bool = False) -> EffectTerms:
        """First order in the error of position, rate and acceleration."""
        signals, motion, j = self.signals(along), along.experiment.motion, self.joint
        beside = signals["value"] - signals["load"]
        change, by, by_value = self.error(along, signals, beside, parameters, bare)
        errors = [self.error(along, signals, x[:, j], parameters, bare)[:2] for x in (motion.q, motion.qd, motion.qdd)]
        terms = self.moved(along.experiment, *(np.stack(x, 1) for x in zip(*errors, strict=True)))
        own = [(c, x + change, columns + by) if c == j else (c, x, columns) for c, x, columns in terms]
        return self._told(along, own, parameters, by_value)


class LinkPlace(EffectPlace):
    """A link: a change of its ten inertial parameters (m = 10); its columns of the regressor give the torque."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """The link's inertial parameters (1, 10) and its far end (1, 3) [m], which no sample changes."""
        return self._link()

    def _link(self) -> dict[str, Array]:
        return {"phi": self.tree.links[self.joint].phi[None], "tip": far_end(self.tree, self.joint)[None]}

    def change(self, parameters: Array) -> tuple[Array, Array]:
        """Change of the inertial parameters (10,), and its derivative by the effect's parameters (10, p)."""
        link = self._link()
        law = evaluate_law(self.placed.effect, link, parameters)
        return law.values[0] - link["phi"][0], law.by_parameter[0]

    def masses(self, parameters: Array) -> Array | None:
        """A link's mass is the first of its inertial parameters."""
        return self.change(parameters)[1][0]

    def once_more(self, parameters: Array) -> Array | None:
        """Of a law that can change all that a link's properties have: the link's density by one factor."""
        phi, by_parameter = self._link()["phi"][0], self.change(parameters)[1]
        found = np.linalg.lstsq(by_parameter, phi)[0]
        return found if np.allclose(by_parameter @ found, phi, rtol=1e-9, atol=1e-12) else None

    def terms(self, along: TorqueState, parameters: Array, bare: bool = False) -> EffectTerms:
        """Linear in the change, whatever ``bare`` says."""
        return EffectTerms(self.spread(along.experiment, *self.change(parameters)))

    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """Through the regressor: values (10,), by_parameter (10, p)."""
        return [(c, own @ values, own @ by_parameter) for c, own in experiment.regressor.of_link(self.joint)]


class BasePlace(EffectPlace):
    """The base of a floating arm: a wrench on it (m = 6)."""

    def signals(self, along: TorqueState) -> dict[str, Array]:
        """Its spin, rates and impulse."""
        return base_signals(along.experiment)

    def spread(self, experiment: Experiment, values: Array, by_parameter: Array) -> list[ChannelTerm]:
        """The wrench that the effect gives to the base reduces the wrench that is needed from outside."""
        return [(c, -values[:, c], -by_parameter[:, c]) for c in rows(self.placed.effect)]
