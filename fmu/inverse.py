"""Torque of a model along a given motion, as ``snarelab simulate`` has it: inverse dynamics with every effect.

Inputs are the motion ``q qd qdd`` of every joint, outputs ``tau`` as the sensors would read it. Hidden states are
stepped by ROS2 (Verwer, Spee, Blom and Hundsdorfer 1999), with the motion linear between communication points, just as
`snarelab.models.hidden_state` steps them between samples.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np

from ..errors import InputError
from ..models.model import Model, Placed
from ..models.rig.rig import Rig
from ..models.rigid_body import symbolic_torque
from .equations import Equations, Ledger
from .placed_laws import PlacedLaws, identifier

_GAMMA = 1 - np.sqrt(0.5)
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
        A parameter without a value, an effect of a suspension rig, or a delayed position sensor, whose torque
        would have to be known ahead of time.
    """
    for p in model.effects:
        if p.effect.at not in ("joint", "link", "sensor"):
            raise InputError(
                f"{model.path}: {p.key} is of a suspension rig or a base, and an FMU of an arm has none; drop it"
            )
        if p.at.startswith("q."):
            raise InputError(
                f"{model.path}: {p.key} makes the torque early against the motion: an FMU that follows it would "
                "have to know it ahead; drop the effect and shift the motion, or export without --inverse"
            )
    return _Follower(model).written()


class _Follower:
    """Writes one model into a ledger."""

    def __init__(self, model: Model) -> None:
        self.model, self.ledger, self.n = model, Ledger(), len(model.joints)
        self.units = [("m", "N") if j.kind == "prismatic" else ("rad", "N*m") for j in model.tree.joints]
        for name, rate, words in (("q", "", "position"), ("qd", "/s", "speed"), ("qdd", "/s^2", "acceleration")):
            for joint, (unit, _) in zip(model.joints, self.units, strict=True):
                self.ledger.input(f"{name}.{joint}", unit + rate, f"{words} of {joint}")
        self.laws = PlacedLaws(model, self.ledger)
        self.phi = ca.vertcat(*self.laws.link_parameters())
        q, qd, qdd = (ca.SX.sym(name, self.n) for name in ("position", "speed", "acceleration"))
        # Slings of a rig move with the arm, and carry what its nominal masses weigh.
        self.balanced = isinstance(model.tree, Rig)
        felt = ca.SX(3, 1) if self.balanced else self._gravity
        torque = symbolic_torque(model.tree, q, qd, qdd, felt, ca.SX(model.tree.phi))
        self.slopes = ca.Function("slopes", [q, qd, qdd], [ca.jacobian(torque, s) for s in (q, qd, qdd)])

    @property
    def _gravity(self) -> ca.SX:
        return ca.SX(ca.DM(self.model.tree.gravity))

    def written(self) -> Equations:
        ledger, t, u = self.ledger, self.ledger.time, self.ledger.inputs()
        states: dict[str, ca.SX] = {}

        def at_rest(p: Placed, signals: list[_Signals]) -> list[ca.SX]:
            found = self.laws.steady(p, signals[0])
            states[p.key] = ca.vertcat(*(ledger.state(x) for x in ca.vertsplit(found)))
            return [found]

        self._torque([(t, u)], at_rest)
        (readings,) = self._torque([(t, u)], lambda p, _: [states[p.key]])
        for joint, (_, unit), reading in zip(self.model.joints, self.units, ca.vertsplit(readings), strict=True):
            ledger.output(f"tau.{joint}", unit, reading, f"torque or force at {joint} as its sensor reads it")
        words = ", ".join(dict.fromkeys(p.effect.name for p in self.model.effects)) or "no effects"
        description = f"Torques of an arm of {self.n} joints along a given motion; with {words}."
        return ledger.following(f"{identifier(self.model.name)}_inverse", description, self._advance(states))

    def _advance(self, states: dict[str, ca.SX]) -> ca.Function:
        """States a step of h later."""
        ledger, t, u = self.ledger, self.ledger.time, self.ledger.inputs()
        h, before = ca.SX.sym("h"), ca.SX.sym("before", u.numel())
        later: dict[str, ca.SX] = {}

        def stepped(p: Placed, signals: list[_Signals]) -> list[ca.SX]:
            here, there = signals
            later[p.key] = self._stepped(p, states[p.key], here, there, h)
            return [states[p.key], later[p.key]]

        self._torque([(t, before), (t + h, u)], stepped)
        x = ca.vertcat(*states.values()) if states else ca.SX(0, 1)
        found = ca.vertcat(*later.values()) if later else ca.SX(0, 1)
        return ca.Function("model_advance", [t, h, x, before, u, ledger.parameters()[0]], [ca.cse(ca.densify(found))])

    def _torque(
        self, ends: list[tuple[ca.SX, ca.SX]], states_at: Callable[[Placed, list[_Signals]], list[ca.SX]]
    ) -> list[ca.SX]:
        """Readings (J,) at each (time, inputs), effect after effect; ``states_at`` gives an effect's states there."""
        n, laws = self.n, self.laws
        motions = [(u[:n], u[n : 2 * n], u[2 * n : 3 * n]) for _, u in ends]
        loads = [symbolic_torque(self.model.tree, q, qd, qdd, self._gravity, self.phi) for q, qd, qdd in motions]
        if self.balanced:
            still, nominal = ca.SX(n, 1), ca.SX(self.model.tree.phi)
            weights = [symbolic_torque(self.model.tree, m[0], still, still, self._gravity, nominal) for m in motions]
            loads = [load - weight for load, weight in zip(loads, weights, strict=True)]
        slopes = [self.slopes(q, qd, qdd) for q, qd, qdd in motions]
        readings = list(loads)
        # Sensors read what all the others add up to, so they come last.
        for p in laws.at("joint") + laws.at("sensor"):
            if p.at.startswith("q_link."):
                continue  # no torque's business
            j = laws.joint_of(p)
            signals = [
                self._signals(j, *end) | {"load": load[j], "value": reading[j], "inertia": by_qdd[j, j]}
                for end, load, reading, (_, _, by_qdd) in zip(ends, loads, readings, slopes, strict=True)
            ]
            states = states_at(p, signals) if p.effect.states else [ca.SX(0, 1)] * len(ends)
            for k, (given, x) in enumerate(zip(signals, states, strict=True)):
                law, change = laws.law(p, given | _named(p, x)), ca.SX(n, 1)
                if p.effect.at == "sensor":
                    change[j] = law - readings[k][j]
                elif p.effect.acts_on == "torque":
                    change[j] = law
                else:
                    change = sum(
                        (slope[:, j] * d for slope, d in zip(slopes[k], ca.vertsplit(law), strict=True)), change
                    )
                readings[k] = readings[k] + change
        return readings

    def _signals(self, j: int, t: ca.SX, u: ca.SX) -> _Signals:
        """What joint j's effects may read at a time and inputs."""
        n, here = self.n, ca.vertcat(self.ledger.time, self.ledger.inputs())
        own = {name: ca.substitute(x, here, ca.vertcat(t, u)) for name, x in self.laws.signals(j).items()}
        return own | {"q": u[j], "qd": u[n + j], "qdd": u[2 * n + j]}

    def _stepped(self, p: Placed, x: ca.SX, here: _Signals, there: _Signals, h: ca.SX) -> ca.SX:
        """One step of ROS2 (see `snarelab.models.hidden_state`)."""
        state = ca.SX.sym("state", x.numel())
        read = {name: ca.SX.sym(name) for name in here}
        u, rate = ca.vertcat(*read.values()), self.laws.rate(p, read | _named(p, state))
        parameters = self.ledger.parameters()[0]
        f = ca.Function("f", [state, u, parameters], [rate, ca.jacobian(rate, state), ca.jacobian(rate, u)])
        first, last = ca.vertcat(*here.values()), ca.vertcat(*there.values())
        at_first, by_state, by_input = f(x, first, parameters)
        matrix, drift = ca.SX.eye(x.numel()) - _GAMMA * h * by_state, _GAMMA * h * by_input @ (last - first)
        k1 = ca.solve(matrix, h * at_first + drift)
        k2 = ca.solve(matrix, h * f(x + k1, last, parameters)[0] - 2 * k1 - drift)
        return x + 1.5 * k1 + 0.5 * k2


def _named(p: Placed, x: ca.SX) -> _Signals:
    return dict(zip(p.effect.states, ca.vertsplit(x) if x.numel() else [], strict=True))
