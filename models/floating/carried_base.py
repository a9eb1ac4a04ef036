"""A floating base while its joints follow a known path: what it does, from the momentum of base and arm.

The joints' motion q(t) is given, so that only the base is free. Its twist follows from the momentum that the state
holds, (v, w) = H_b^-1 (momentum - H_bm qd), and what acts at the base from outside or inside it, effects included,
changes that momentum. Laws at the base read its acceleration a, in which they are linear; it solves
H_b a = W(a) - H_bm qdd - c_b (`symbols`), with W the wrench on the base.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..compiled import SampleFunction
from ..dormand_prince import DormandPrince
from ..effect import Effect
from ..hidden_state import SIGNALS
from ..inertia import Array
from ..rotation import quaternion_rate, rotation_of
from . import symbols
from .arm import FloatingArm

_STATES = 13  # position, quaternion, momentum: linear, and angular about the world's origin


@dataclass(frozen=True, eq=False)
class JointPath:
    """What is given at n samples: joints' q, qd and qdd (n, J), the wrench from outside (n, 6) along the base's axes,
    linear part first [N, N·m], the torque that wheels are told to give the base (n, 3) [N·m] and its integral (n, 3).
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    outside: Array
    wheels: Array
    impulse: Array


@dataclass(frozen=True, eq=False)
class BaseTrajectory:
    """Motion of the base at n samples: position (n, 3) and quaternion (n, 4; w, x, y, z) in the world, twist and
    acceleration (n, 6), the latter as an observer at rest sees it, along the base's own axes, linear part first."""

    position: Array
    quaternion: Array
    twist: Array
    acceleration: Array


class CarriedBase:
    """Equations of motion of a base under an arm that follows a path.

    Parameters
    ----------
    arm : FloatingArm
    effects : sequence of (Effect, array (p,))
        Effects at the base with their parameters; hidden states start at zero.
    tolerance : float
        Relative error of one step, see `DormandPrince`.
    """

    def __init__(self, arm: FloatingArm, effects: Sequence[tuple[Effect, Array]] = (), tolerance: float = 1e-9) -> None:
        """Write and compile the equations."""
        self.arm, self._effects, n = arm, tuple(effects), arm.n_joints
        self.n_states = _STATES + sum(len(effect.states) for effect, _ in self._effects)
        x, time = ca.SX.sym("x", self.n_states), ca.SX.sym("t")
        # time at the interval's start, the spin at the path's, six coefficients of each joint, four lines
        u = ca.SX.sym("u", 4 + 6 * n + 2 * 12)
        passed = time - u[0]
        terms = ca.reshape(u[4 : 4 + 6 * n], n, 6)
        powers = ca.vertcat(*(passed**k for k in range(6)))
        q = terms @ powers
        qd, qdd = terms @ ca.jacobian(powers, time), terms @ ca.jacobian(ca.jacobian(powers, time), time)
        lines = u[4 + 6 * n : 16 + 6 * n] + passed * u[16 + 6 * n :]
        rate, _, _ = self._equations(x, time, q, qd, qdd, lines, u[1:4])
        mass = float(arm.base[0]) + float(arm.tree.phi[::10].sum())
        floor = np.concatenate([np.ones(7), np.full(6, mass), np.ones(self.n_states - _STATES)])
        self._steps = DormandPrince(ca.Function("rate", [time, x, u], [ca.cse(rate)]), floor, tolerance)
        given = [x, time, *(ca.SX.sym(k, n) for k in ("q", "qd", "qdd")), ca.SX.sym("lines", 12), ca.SX.sym("spin", 3)]
        _, twist, acceleration = self._equations(*given)
        self._seen = SampleFunction(ca.Function("seen", given, [ca.cse(ca.vertcat(twist, acceleration))]))

    def follow(self, path: JointPath, position: Array, quaternion: Array, twist: Array | None = None) -> BaseTrajectory:
        """Go along a path from a pose in the world and a twist (6,) in the base's axes; None: without any momentum.

        Raises
        ------
        StepFault
            Where the equations have no finite solution.
        """
        start, first = np.zeros(self.n_states), np.zeros(6)
        start[:3], start[3:7] = position, quaternion / np.linalg.norm(quaternion)
        at = [path.time[:1, None], path.q[:1], path.qd[:1], path.qdd[:1]]
        lines = np.hstack([path.outside, path.wheels, path.impulse])
        if twist is None:
            first = self._seen(start[None], *at, lines[:1], np.zeros(3))[0][0, :6, 0]
        else:
            first = np.asarray(twist, float)
            start[7:13] = self._momentum(path.q[0], path.qd[0], first, start)
        states = np.empty((len(path.time), self.n_states))
        states[0] = start
        held = np.hstack([path.time[:-1, None], np.tile(first[3:], (len(path.time) - 1, 1)), _curves(path)])
        steps = np.diff(path.time)
        held = np.hstack([held, lines[:-1], np.diff(lines, axis=0) / steps[:, None]])
        size = float(steps[0])
        for k, inputs in enumerate(held):
            done = self._steps.advance(path.time[k], states[k], path.time[k + 1], inputs, size)
            states[k + 1], size = done.state, done.size
        seen = self._seen(states, path.time[:, None], path.q, path.qd, path.qdd, lines, first[3:])[0][:, :, 0]
        unit = states[:, 3:7] / np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
        return BaseTrajectory(states[:, :3], unit, seen[:, :6], seen[:, 6:])

    def _momentum(self, q: Array, qd: Array, twist: Array, start: Array) -> Array:
        """Momentum (6,) in the world that goes with a twist."""
        whole = ca.Function("whole", [q_ := ca.SX.sym("q", len(q))], [symbols.inertia(self.arm, q_)[:6, :]])(q)
        own = np.asarray(whole, float) @ np.concatenate([twist, qd])
        turned = np.asarray(ca.DM(ca.evalf(rotation_of(ca.SX(start[3:7])))))
        linear = turned @ own[:3]
        return np.concatenate([linear, turned @ own[3:] + np.cross(start[:3], linear)])

    def _equations(
        self, x: ca.SX, time: ca.SX, q: ca.SX, qd: ca.SX, qdd: ca.SX, lines: ca.SX, spin: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rate of the states, twist and acceleration of the base."""
        position, quaternion, linear, angular = x[:3], x[3:7], x[7:10], x[10:13]
        rotation, whole = rotation_of(quaternion), symbols.inertia(self.arm, q)
        own = ca.vertcat(rotation.T @ linear, rotation.T @ (angular - ca.cross(position, linear)))
        h_b, h_bm = whole[:6, :6], whole[:6, 6:]
        twist = ca.solve(h_b, own - h_bm @ qd)
        acceleration = ca.SX.sym("acceleration", 6)
        # The wheels keep what they were told to give: its direction turns with the base.
        inside = lines[6:9] + ca.cross(twist[3:], lines[9:12])
        signals = {
            "spin": twist[3:],
            "spin_rate": acceleration[3:],
            "acceleration": acceleration[:3],
            "spin_gained": twist[3:] - spin,
            "impulse": lines[9:12],
            "time": time,
        }
        wrench, hidden = self._laws(x[_STATES:], signals)
        wrench += lines[:6] + ca.vertcat(ca.SX(3, 1), inside)
        bias = symbols.bias(self.arm, q, twist, qd, ca.SX(3, 1))[:6]
        still, by_acceleration = ca.substitute(wrench, acceleration, ca.SX.zeros(6)), ca.jacobian(wrench, acceleration)
        found = ca.solve(h_b - by_acceleration, still - h_bm @ qdd - bias)
        wrench, hidden = (ca.substitute(part, acceleration, found) for part in (wrench, hidden))
        push, moment = rotation @ wrench[:3], rotation @ wrench[3:]
        rates = [
            rotation @ twist[:3],
            quaternion_rate(quaternion, twist[3:]),
            push,
            ca.cross(position, push) + moment,
            hidden,
        ]
        return ca.densify(ca.vertcat(*rates)), twist, found

    def _laws(self, hidden: ca.SX, signals: Mapping[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
        """Wrench (6,) of all effects and the rates of their hidden states."""
        assert signals.keys() == SIGNALS["base"].keys()
        wrench, rates, done = ca.SX(6, 1), [], 0
        for effect, values in self._effects:
            states = dict(zip(effect.states, ca.vertsplit(hidden[done:]), strict=False)) if effect.states else {}
            done += len(effect.states)
            p = {a.name: ca.SX(float(value)) for a, value in zip(effect.parameters, values, strict=True)}
            wrench += effect.law({**signals, **states}, p)
            rates += effect.rate({**signals, **states}, p) if effect.rate else []
        return wrench, ca.vertcat(*rates) if rates else ca.SX(0, 1)


def _curves(path: JointPath) -> Array:
    """Coefficients (n - 1, 6 J) of quintics through position, rate and acceleration at both ends."""
    h = np.diff(path.time)[:, None]
    q, v, a = path.q[:-1], path.qd[:-1] * h, path.qdd[:-1] * h**2
    gone = path.q[1:] - q - v - a / 2
    faster, more = path.qd[1:] * h - v - a, path.qdd[1:] * h**2 - a
    third, fourth = 10 * gone - 4 * faster + more / 2, -15 * gone + 7 * faster - more
    fifth = 6 * gone - 3 * faster + more / 2
    return np.hstack([c / h**k for k, c in enumerate((q, v, a / 2, third, fourth, fifth))])
