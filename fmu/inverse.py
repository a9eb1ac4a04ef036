"""Torque of a model along a given motion, as ``snarelab simulate`` has it: inverse dynamics with every effect.

Inputs are the motion ``q qd qdd`` of every joint, outputs ``tau`` as the sensors would read it. The motion is the true
one: where a position sensor is late, ``sensor.q.<joint>`` is what it reads of it. (A recording has the reading, and
`simulate`, which knows all of it, turns the delay round; an FMU cannot know a motion ahead.) For the same reason, where
a drive is late ``tau`` is the torque that it delivers: its command was given the delay before. On a floating base its
motion is given too, and the force and moment that it needs from outside come out: none, where the model is complete.

Hidden states are stepped with the motion linear between communication points, as `snarelab.models.ros2` steps
them between samples.
"""

import warnings
from collections.abc import Callable

import casadi as ca
import numpy as np

from ..models.axes import Place
from ..models.beam import symbolic_beam
from ..models.empirical import TableLaw
from ..models.model import Model, PlacedEffect
from ..models.rig.rig import Rig
from ..models.rigid_body import symbolic_torque
from ..models.ros2 import ros2
from .base_motion import BaseMotion
from .equations import Equations, Ledger
from .placed_laws import PlacedLaws, identifier, summed
from .suspension import PLACES, rig_reach, rig_signals

_Signals = dict[str, ca.SX]


def inverse_equations(model: Model) -> Equations:
    """Equations that follow a motion.

    Parameters
    ----------
    model : Model
        Its file must hold a value for every parameter.

    Raises
    ------
    InputError
        A parameter without a value.
    """
    return _Follower(model).written()


class _Follower:
    """Writes one model into a ledger."""

    def __init__(self, model: Model) -> None:
        self.model, self.ledger, self.first = model, Ledger(), model.tree.carriers
        self.joints, joints = model.joints[self.first :], model.tree.joints[self.first :]
        self.n = len(joints)
        self.units = [("m", "N") if j.kind == "prismatic" else ("rad", "N*m") for j in joints]
        for name, rate, words in (("q", "", "position"), ("qd", "/s", "speed"), ("qdd", "/s^2", "acceleration")):
            for joint, (unit, _) in zip(self.joints, self.units, strict=True):
                self.ledger.input(f"{name}.{joint}", unit + rate, f"{words} of {joint}")
        self.base = BaseMotion(self.ledger) if self.first else None
        self.laws = PlacedLaws(model, self.ledger)
        self.encoders: dict[str, ca.SX] = {}
        self.held: dict[str, ca.SX] = {}
        self.phi = ca.vertcat(*self.laws.link_parameters())
        size = self.first + self.n
        q, qd, qdd = (ca.SX.sym(name, size) for name in ("position", "speed", "acceleration"))
        # Slings of a rig move with the arm, and carry what its nominal masses weigh.
        self.balanced = isinstance(model.tree, Rig)
        felt = ca.SX(3, 1) if self.balanced else self._gravity
        torque = symbolic_torque(model.tree, q, qd, qdd, felt, ca.SX(model.tree.phi))
        self.slopes = ca.Function("slopes", [q, qd, qdd], [ca.jacobian(torque, s) for s in (q, qd, qdd)])

    @property
    def _gravity(self) -> ca.SX:
        return ca.SX(ca.DM(self.model.tree.gravity))

    def _motion(self, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Positions, rates and second rates of all the tree's joints."""
        own = u[: self.n], u[self.n : 2 * self.n], u[2 * self.n : 3 * self.n]
        if self.base is None:
            return own
        q, qd, qdd = (ca.vertcat(*both) for both in zip(self.base.carriers(u), own, strict=True))
        return q, qd, qdd

    def written(self) -> Equations:
        ledger, t, u = self.ledger, self.ledger.time, self.ledger.inputs()
        states: dict[str, ca.SX] = {}
        memory = ca.SX(0, 1)
        if self.base is not None:
            first = self.base.start(u)
            states["memory"] = memory = ca.vertcat(*(ledger.state(x) for x in ca.vertsplit(first)))

        def at_rest(p: PlacedEffect, signals: list[_Signals]) -> list[ca.SX]:
            found = self.laws.steady(p, signals[0])
            states[p.key] = ca.vertcat(*(ledger.state(x) for x in ca.vertsplit(found)))
            return [found]

        self._torque([(t, u, memory if self.base is None else self.base.start(u))], at_rest)
        (readings,) = self._torque([(t, u, memory)], lambda p, _: [states[p.key]])
        if self.base is not None:
            words = "that the base's motion needs from outside, in its axes"
            ledger.vector("force.base", "N", readings[:3], f"force {words}")
            ledger.vector("torque.base", "N*m", readings[3:6] - self.base.wheels(u, memory), f"moment {words}")
        for joint, (_, unit), reading in zip(
            self.joints, self.units, ca.vertsplit(readings[self.first :]), strict=True
        ):
            ledger.output(f"tau.{joint}", unit, reading, f"torque or force at {joint} {self._words(f'tau.{joint}')}")
        for channel, reading in self.encoders.items():
            unit = self.units[self.joints.index(channel.removeprefix("q."))][0]
            ledger.output(f"sensor.{channel}", unit, reading, f"what the sensor of {channel} reads")
        for at, outside in self.held.items():
            self.laws.tell_held(at, outside)
        words = ", ".join(dict.fromkeys(p.effect.name for p in self.model.effects)) or "no effects"
        description = f"Torques of an arm of {self.n} joints along a given motion; with {words}."
        return ledger.following(f"{identifier(self.model.name)}_inverse", description, self._advance(states))

    def _words(self, channel: str) -> str:
        """What a torque output is; a warning where it is no reading."""
        late = [p for p in self.model.effects if p.effect.leads and p.at == channel]
        if not late:
            return "as its sensor reads it"
        by = " + ".join(f"{p.key}.{x.name}" for p in late for x in p.effect.parameters)
        warnings.warn(
            f"{self.model.path}: output {channel} is the torque delivered: its command leads it by {by}, and an FMU "
            "cannot know the motion ahead; 'snarelab simulate' gives the command, an FMU without --inverse takes it",
            stacklevel=2,
        )
        return f"as it is delivered; its command leads it by {by}"

    def _advance(self, states: dict[str, ca.SX]) -> ca.Function:
        """States a step of h later."""
        ledger, t, u = self.ledger, self.ledger.time, self.ledger.inputs()
        h, before = ca.SX.sym("h"), ca.SX.sym("before", u.numel())
        later: dict[str, ca.SX] = {}

        def stepped(p: PlacedEffect, signals: list[_Signals]) -> list[ca.SX]:
            here, there = signals
            later[p.key] = self._stepped(p, states[p.key], here, there, h)
            return [states[p.key], later[p.key]]

        memories = [ca.SX(0, 1)] * 2
        if self.base is not None:
            later["memory"] = self.base.later(states["memory"], before, u, h)
            memories = [states["memory"], later["memory"]]
        self._torque([(t, before, memories[0]), (t + h, u, memories[1])], stepped)
        x = ca.vertcat(*states.values()) if states else ca.SX(0, 1)
        found = ca.vertcat(*later.values()) if later else ca.SX(0, 1)
        return ca.Function("model_advance", [t, h, x, before, u, ledger.parameters()[0]], [ca.cse(ca.densify(found))])

    def _torque(
        self, ends: list[tuple[ca.SX, ca.SX, ca.SX]], states_at: Callable[[PlacedEffect, list[_Signals]], list[ca.SX]]
    ) -> list[ca.SX]:
        """Readings (base and J,) at each (time, inputs, base's memory); ``states_at`` gives an effect's states there.

        What position sensors read at the last of them is left in ``encoders``.
        """
        n, laws = self.first + self.n, self.laws
        motions = [self._motion(u) for _, u, _ in ends]
        loads = [symbolic_torque(self.model.tree, q, qd, qdd, self._gravity, self.phi) for q, qd, qdd in motions]
        if self.balanced:
            still, nominal = ca.SX(n, 1), ca.SX(self.model.tree.phi)
            weights = [symbolic_torque(self.model.tree, m[0], still, still, self._gravity, nominal) for m in motions]
            loads = [load - weight for load, weight in zip(loads, weights, strict=True)]
        slopes = [self.slopes(q, qd, qdd) for q, qd, qdd in motions]
        readings, rig = list(loads), self.model.tree
        # Sensors read what all the others add up to, so they come last.
        for p in laws.at("joint", "beam", "base", *PLACES) + laws.at("sensor"):
            if p.at.startswith("q_link.") or p.effect.leads:
                continue  # neither torque nor motor's position; or ahead of the motion
            j = self.first + laws.joint_of(p)
            encoder = p.effect.at == "sensor" and p.at.startswith("q.")
            signals = [
                self._signals(p, *end) | {"value": reading[j]} | self._carried(p, j, load, by_qdd)
                for end, load, reading, (_, _, by_qdd) in zip(ends, loads, readings, slopes, strict=True)
            ]
            if isinstance(rig, Rig) and p.effect.at in PLACES:
                signals = [s | rig_signals(rig, p, m[0], m[1]) for s, m in zip(signals, motions, strict=True)]
            turns: list[ca.SX] = []
            if p.effect.at == "beam":
                nominal = ca.SX(self.model.tree.phi)
                found = [symbolic_beam(self.model.tree, j, m, self._gravity, nominal) for m in motions]
                own = [{"moment": x[0], "inertia_beyond": ca.vec(x[1])} for x in found]
                signals = [s | x for s, x in zip(signals, own, strict=True)]
                turns = [ca.horzcat(*x[2:]) for x in found]
            if encoder:
                signals = [s | {"value": m[0][j]} for s, m in zip(signals, motions, strict=True)]
            states = states_at(p, signals) if p.effect.states else [ca.SX(0, 1)] * len(ends)
            for k, (given, x) in enumerate(zip(signals, states, strict=True)):
                law, change = laws.law(p, given | _named(p, x)), ca.SX(n, 1)
                if encoder:
                    self.encoders[p.at] = law
                elif p.effect.at == "sensor":
                    change[j] = law - readings[k][j]
                elif p.effect.at == "base":  # what the effect gives the base, nothing else has to
                    change[: self.first] = -law
                elif p.effect.at == "beam":
                    change = turns[k] @ law
                elif isinstance(rig, Rig) and p.effect.at in PLACES:
                    change = rig_reach(rig, p, motions[k][0]) @ law
                elif p.effect.acts_on == "torque":
                    if isinstance(p.effect.law, TableLaw):
                        self.held[p.at] = p.effect.law.held(given | _named(p, x))
                    here = laws.place_of(p)
                    for c in here.channels:
                        change[self.first + int(c)] = law if here.alone is not None else float(here.along[c]) * law
                else:
                    change = sum(
                        (slope[:, j] * d for slope, d in zip(slopes[k], ca.vertsplit(law), strict=True)), change
                    )
                readings[k] = readings[k] + change
        return readings

    def _signals(self, p: PlacedEffect, t: ca.SX, u: ca.SX, memory: ca.SX) -> _Signals:
        """What an effect may read of time, inputs and the base's memory."""
        n, here = self.n, ca.vertcat(self.ledger.time, self.ledger.inputs())
        own = {name: ca.substitute(x, here, ca.vertcat(t, u)) for name, x in self.laws.signals(p).items()}
        if p.effect.at == "base" and self.base is not None:
            return own | self.base.signals(u, memory)
        along = self._direction(p).along
        own |= self.laws.of_others(p, u[:n], u[n : 2 * n])
        return own | {name: summed(along, u[k * n : (k + 1) * n]) for k, name in enumerate(("q", "qd", "qdd"))}

    def _direction(self, p: PlacedEffect) -> Place:
        """The joint or axis whose motion an effect reads."""
        if p.effect.at in ("joint", "sensor"):
            return self.laws.place_of(p)
        one = np.eye(self.n)[self.laws.joint_of(p)]
        return Place(p.at, one, one, "revolute")

    def _carried(self, p: PlacedEffect, j: int, load: ca.SX, by_qdd: ca.SX) -> _Signals:
        """Load and inertia that a joint's law, or a sensor's, reads."""
        if p.effect.at not in ("joint", "sensor"):
            return {"load": load[j], "inertia": by_qdd[j, j]}
        back, own = self.laws.place_of(p).back, by_qdd[self.first :, self.first :]
        across = ca.vertcat(*(summed(back, own[k, :].T) for k in range(self.n)))
        return {"load": summed(back, load[self.first :]), "inertia": summed(back, across)}

    def _stepped(self, p: PlacedEffect, x: ca.SX, here: _Signals, there: _Signals, h: ca.SX) -> ca.SX:
        """One step, as `snarelab.models.ros2` takes it between samples."""
        if p.effect.advance:
            return self.laws.advanced(p, here | _named(p, x), there, h)
        state = ca.SX.sym("state", x.numel())
        read = {name: ca.SX.sym(name, x.numel()) for name, x in here.items()}
        u, rate = ca.vertcat(*read.values()), self.laws.rate(p, read | _named(p, state))
        parameters = self.ledger.parameters()[0]
        f = ca.Function("f", [state, u, parameters], [rate, ca.jacobian(rate, state), ca.jacobian(rate, u)])
        first, last = ca.vertcat(*here.values()), ca.vertcat(*there.values())
        return ros2(lambda x, u: f(x, u, parameters), x, first, last, h)


def _named(p: PlacedEffect, x: ca.SX) -> _Signals:
    return dict(zip(p.effect.states, ca.vertsplit(x) if x.numel() else [], strict=True))
