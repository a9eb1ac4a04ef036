"""The base of an arm in an FMU: fixed, or floating with wrenches, reaction wheels and its own effects.

Everything is in the base's own axes unless said otherwise. What wheels are told to give the base, they keep: the
impulse's direction turns with the base, which gives ``spin x impulse`` beside the torque itself (Wertz 1978, 7.9).
"""

from math import inf

import casadi as ca

from ..models.floating.arm import FloatingArm
from ..models.floating.symbols import by_base
from ..models.rotation import quaternion_rate, rotation_of
from ..recordings.signals import POSE
from .equations import Ledger
from .placed_laws import PlacedLaws


class Base:
    """States and inputs of a base, and the wrenches on it.

    Parameters
    ----------
    arm : FloatingArm
    ledger : Ledger
        Takes inputs, parameters of the start, and states; nothing where the base stands still.
    laws : PlacedLaws

    Attributes
    ----------
    size : 0 or 6
        Degrees of freedom.
    pose, twist : casadi.SX (7,), (6,)
        Position [m] and quaternion (w, x, y, z) in the world; velocity and spin [m/s, rad/s].
    turn : casadi.SX (3, 3)
        Base to world.
    given : casadi.SX (6,)
        Force and moment about the origin from outside and from wheels [N, N·m].
    """

    def __init__(self, arm: FloatingArm, ledger: Ledger, laws: PlacedLaws) -> None:
        """Register everything."""
        self._laws, self._placed = laws, laws.at("base")
        self.size = 6 if arm.floating else 0
        self.pose, self.twist = ca.SX([0, 0, 0, 1, 0, 0, 0]), ca.SX(6, 1)
        self.turn, self.given = ca.SX.eye(3), ca.SX(6, 1)
        if not self.size:
            return
        first = _start(ledger)
        states = [ledger.state(x) for x in first]
        self.pose, self.twist = ca.vertcat(*states[:7]), ca.vertcat(*states[7:])
        self.turn, self._first_spin = rotation_of(self.pose[3:]), ca.vertcat(*first[10:])
        self.given = self._wrench(ledger, "base", "at its frame", ca.SX(3, 1))
        if arm.mount is not None:
            self.given += self._wrench(ledger, "mount", "at its mount", ca.SX(ca.DM(arm.mount[1])))
        self._told = ledger.vector_input(
            "torque.wheels", "N*m", "torque that reaction wheels are told to give the base"
        )
        self._impulse = ca.vertcat(*(ledger.state() for _ in range(3)))
        self.given += ca.vertcat(ca.SX(3, 1), self._told + ca.cross(self.twist[3:], self._impulse))
        self._hidden = {p.key: {name: ledger.state() for name in p.effect.states} for p in self._placed}

    def _wrench(self, ledger: Ledger, body: str, where: str, point: ca.SX) -> ca.SX:
        """What acts on a point of the base, as a wrench about its frame's origin."""
        words = f"on the base {where}, in the world frame"
        force = ledger.vector_input(f"force.{body}", "N", f"force from outside {words}")
        moment = ledger.vector_input(f"torque.{body}", "N*m", f"moment from outside {words}")
        return by_base(point).T @ ca.vertcat(self.turn.T @ force, self.turn.T @ moment)

    def wrench(self, acceleration: ca.SX) -> ca.SX:
        """Wrench of the effects on the base (size,), at an inertial acceleration (size,) of the base."""
        total = ca.SX(self.size, 1)
        for p in self._placed:
            total += self._laws.law(p, self._signals(acceleration) | self._hidden[p.key])
        return total

    def rates(self, acceleration: ca.SX) -> list[ca.SX]:
        """Rates of the states, in their order."""
        if not self.size:
            return []
        velocity, spin = self.twist[:3], self.twist[3:]
        found = ca.vertsplit(self.turn @ velocity) + ca.vertsplit(quaternion_rate(self.pose[3:], spin))
        # An observer at rest sees the origin accelerate; seen from the turning base its velocity changes by less.
        found += ca.vertsplit(acceleration[:3] - ca.cross(spin, velocity)) + ca.vertsplit(acceleration[3:])
        found += ca.vertsplit(self._told)
        for p in self._placed:
            if p.effect.states:
                found += ca.vertsplit(self._laws.rate(p, self._signals(acceleration) | self._hidden[p.key]))
        return found

    def _signals(self, acceleration: ca.SX) -> dict[str, ca.SX]:
        """What a law at the base reads."""
        return self._laws.signals() | {
            "spin": self.twist[3:],
            "spin_rate": acceleration[3:],
            "acceleration": acceleration[:3],
            "spin_gained": self.twist[3:] - self._first_spin,
            "impulse": self._impulse,
        }


def _start(ledger: Ledger) -> list[ca.SX]:
    """Pose (7,) and twist (6,) at the start; parameters, which give the twist in the world frame."""
    first = []
    for stem, axes, unit, _ in POSE:
        for axis in axes:
            name = f"{stem}.base.{axis}"
            words = f"{name} at the start, in the world frame"
            bounds = (-1.0, 1.0) if stem == "quat" else (-inf, inf)
            first.append(ledger.parameter(f"start.{name}", unit, float(axis == "w"), words, bounds, fixed=True))
    back = rotation_of(ca.vertcat(*first[3:7])).T
    first[7:10], first[10:13] = (ca.vertsplit(back @ ca.vertcat(*first[k : k + 3])) for k in (7, 10))
    return first
