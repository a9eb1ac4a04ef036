"""What moves and brakes a joint in a simulation: a servo, or motors off, and any registered effects of a joint."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError, nearest
from ..hidden_state import SIGNALS
from ..model import PlacedEffect
from ..tree import Joint
from .arm import FloatingArm

_KNOWN = {"q", "qd", "qdd", "load", "inertia", "time", "speed_scale"}
_NEWTON = 3  # exact after two for a law that is linear in the size of the load


class DriveTorque(NamedTuple):
    """Torque (J,) at the joints, what the effects take of it per acceleration (J,), and the hidden states' rates."""

    torque: ca.SX
    inertia: ca.SX
    rate: ca.SX


class Law(NamedTuple):
    """A drive written out for one arm: number of hidden states, parameters with their values and units, the expression.

    ``expression(time, q, qd, hidden, inertia, target, on, values)`` gives `DriveTorque`.
    """

    n_states: int
    start: dict[str, float]
    units: dict[str, str]
    expression: Callable[..., DriveTorque]


@dataclass(frozen=True, eq=False)
class Drive:
    """Servo and effects of an arm's joints.

    The servo's torque is ``stiffness * (target - q) - damping * qd``; with the motors off it is nothing. An effect's
    law reads, besides position and rate: ``load``, the torque that passes to the link (the motor's less what the effect
    takes), ``inertia``, the joint's own entry of the mass matrix, and ``speed_scale``, the joint's speed limit.

    Parameters
    ----------
    stiffness, damping : array (J,) or None
        Gains of the servo [N·m/rad, N·m·s/rad; or N/m, N·s/m]; None: zero, a joint that is always passive.
    effects : sequence of PlacedEffect
        Effects of a joint that act as a torque, one entry a joint.
    values : mapping of str to float
        Their parameters by ``effect.joint.parameter``; those left out are the effect's usual ones (``zero``).
    """

    stiffness: ArrayLike | None = None
    damping: ArrayLike | None = None
    effects: Sequence[PlacedEffect] = ()
    values: Mapping[str, float] = field(default_factory=dict)

    def law(self, arm: FloatingArm) -> Law:
        """Write the drive out for an arm.

        Raises
        ------
        InputError
            Where gains do not fit the joints, an effect does not act as a torque on one of the joints, needs a speed
            limit that the joint does not have, or reads what a simulation does not know; where a parameter is unknown
            or out of its bounds.
        """
        names = [joint.name for joint in arm.tree.joints]
        start: dict[str, float] = {}
        units: dict[str, str] = {}
        for word, given in (("stiffness", self.stiffness), ("damping", self.damping)):
            gains = np.zeros(arm.n_joints) if given is None else np.asarray(given, float)
            if gains.shape != (arm.n_joints,) or not np.isfinite(gains).all() or (gains < 0).any():
                raise InputError(
                    f"{arm.tree.name}: {word} is {gains.tolist()}; give {arm.n_joints} finite numbers >= 0, "
                    "one per joint"
                )
            start |= {f"servo.{name}.{word}": float(gain) for name, gain in zip(names, gains, strict=True)}
            form = "T/S" if word == "stiffness" else "T*s/S"
            units |= {f"servo.{joint.name}.{word}": _unit(form, joint) for joint in arm.tree.joints}
        for placed in self.effects:
            _check(arm, placed, names)
            for p in placed.effect.parameters:
                start[f"{placed.key}.{p.name}"] = p.zero
                units[f"{placed.key}.{p.name}"] = _unit(p.unit, arm.tree.joints[names.index(placed.at)])
        self.check(arm, start, self.values)
        start |= {name: float(value) for name, value in self.values.items()}
        n_states = sum(len(placed.effect.states) for placed in self.effects)

        def expression(
            time: ca.SX, q: ca.SX, qd: ca.SX, hidden: ca.SX, inertia: ca.SX, target: ca.SX, on: ca.SX, values: ca.SX
        ) -> DriveTorque:
            given = dict(zip(start, ca.vertsplit(values), strict=True))
            torques, inertias, rates = [], [], []
            states = iter(ca.vertsplit(hidden) if n_states else [])
            for i, name in enumerate(names):
                kp, kd = given[f"servo.{name}.stiffness"], given[f"servo.{name}.damping"]
                motor = on * (kp * (target[i] - q[i]) - kd * qd[i])
                signals = {
                    "q": q[i],
                    "qd": qd[i],
                    "qdd": ca.SX.sym("qdd"),
                    "load": ca.SX.sym("load"),
                    "inertia": inertia[i],
                    "time": time,
                    "speed_scale": ca.SX(arm.tree.joints[i].speed),
                }
                taken, rate = ca.SX(0), []
                for placed in [p for p in self.effects if p.at == name]:
                    own = {state: next(states) for state in placed.effect.states}
                    p = {a.name: given[f"{placed.key}.{a.name}"] for a in placed.effect.parameters}
                    taken += placed.effect.law({**signals, **own}, p)
                    rate += placed.effect.rate({**signals, **own}, p) if placed.effect.rate else []
                torque, per_acceleration, rate = _solved(motor, taken, ca.vertcat(*rate), signals)
                torques.append(torque)
                inertias.append(per_acceleration)
                rates.append(rate)
            return DriveTorque(ca.vertcat(*torques), ca.vertcat(*inertias), ca.vertcat(*rates))

        return Law(n_states, start, units, expression)

    def check(self, arm: FloatingArm, known: Mapping[str, float], values: Mapping[str, float]) -> None:
        """Refuse values of parameters that are not among ``known``, not finite, or out of their bounds."""
        bounds = {}
        for placed in self.effects:
            for p in placed.effect.parameters:
                # bounds that are multiples of a recording's peaks say nothing here, except that they keep a sign
                low = p.low if not p.relative_to else (0.0 if p.low >= 0 else -np.inf)
                bounds[f"{placed.key}.{p.name}"] = low, np.inf if p.relative_to else p.high
        for name, value in values.items():
            if name not in known:
                near = nearest(name, known) or "none"
                raise InputError(f"{arm.tree.name}: no parameter '{name}' (nearest: {near})")
            low, high = bounds.get(name, (0.0, np.inf))
            if not np.isfinite(value) or not low <= value <= high:
                raise InputError(f"{arm.tree.name}: {name} is {value:g}; allowed is {low:g} to {high:g}")


def _unit(form: str, joint: Joint) -> str:
    """An effect's unit with the joint's own torque and position units in it."""
    torque, position = ("N*m", "rad") if joint.kind == "revolute" else ("N", "m")
    return re.sub(r"\bS\b", position, re.sub(r"\bT\b", torque, form))


def _check(arm: FloatingArm, placed: PlacedEffect, names: Sequence[str]) -> None:
    """Refuse an effect that these joints cannot have, or whose law reads what a simulation does not know."""
    effect, name = placed.effect, arm.tree.name
    if effect.at != "joint" or effect.acts_on != "torque":
        raise InputError(f"{name}: {effect.name} is no torque at a joint; a simulated drive takes those only")
    if placed.at not in names:
        raise InputError(f"{name}: {effect.name} at '{placed.at}'; this arm has {', '.join(names)}")
    if effect.others:
        raise InputError(f"{name}: {placed.key} reads other joints ({', '.join(effect.others)}); a drive reads its own")
    signals = {signal: ca.SX.sym(signal, size) for signal, size in SIGNALS["joint"].items()}
    states = {state: ca.SX.sym(state) for state in effect.states}
    p = {a.name: ca.SX.sym(a.name) for a in effect.parameters}
    law = ca.vertcat(effect.law({**signals, **states}, p))
    rate = ca.vertcat(*effect.rate({**signals, **states}, p)) if effect.rate else ca.SX(0, 1)
    by_acceleration = ca.jacobian(law, signals["qdd"])
    if ca.depends_on(by_acceleration, signals["qdd"]) or ca.depends_on(rate, signals["qdd"]):
        raise InputError(f"{name}: {effect.name} is not linear in acceleration and cannot be simulated here")
    read = ca.vertcat(law, rate)
    for signal in signals.keys() - _KNOWN:
        if ca.depends_on(read, signals[signal]):
            raise InputError(f"{name}: {effect.name} reads '{signal}', which a simulated joint does not have")
    speed = arm.tree.joints[names.index(placed.at)].speed
    if ca.depends_on(read, signals["speed_scale"]) and not 0 < speed < np.inf:
        raise InputError(
            f"{name}: {effect.name} needs the speed limit of '{placed.at}', which is {speed:g}; give the joint one"
        )


def _solved(motor: ca.SX, taken: ca.SX, rate: ca.SX, signals: Mapping[str, ca.SX]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Torque, inertia and states' rates of one joint, with the load that the law may read worked out.

    The load solves load = motor - taken(load), by Newton's method.
    """
    load, qdd = signals["load"], signals["qdd"]
    per_acceleration = ca.jacobian(taken, qdd)
    taken, rate = (ca.substitute(x, qdd, ca.SX(0)) for x in (taken, rate))
    if ca.depends_on(ca.vertcat(taken, rate), load):
        step = load - (load + taken - motor) / (1 + ca.jacobian(taken, load))
        value = motor
        for _ in range(_NEWTON):
            value = ca.substitute(step, load, value)
        taken, rate, per_acceleration = (ca.substitute(x, load, value) for x in (taken, rate, per_acceleration))
    return motor - taken, per_acceleration, rate
