"""A floating base with given motion: its inputs, the motion of its carriers, and the signals of laws at the base.

The motion is given in the world frame, as recordings have it, and turned into the base's own axes.
"""

import casadi as ca

from ..models.floating.tree import CARRIERS
from ..models.rotation import rotation_of
from ..recordings.signals import QUATERNION
from .equations import Ledger

_GIVEN = (
    ("vel", "m/s", "velocity of the base's frame"),
    ("omega", "rad/s", "angular velocity of the base"),
    ("acc", "m/s^2", "acceleration of the base's frame"),
    ("alpha", "rad/s^2", "angular acceleration of the base"),
)


def carried_turning(spin: ca.SX) -> ca.SX:
    """Second rates (3,) [rad/s²] of the joints that turn a base of steady spin: each axis is turned by those before."""
    x, y, z = ca.vertsplit(spin)
    return ca.vertcat(-y * z, x * z, -x * y)


class BaseMotion:
    """Inputs ``quat vel omega acc alpha`` of the base and ``torque.wheels``; and a memory (6,) of two things.

    The memory is the spin at the start [rad/s], and the angular impulse [N·m·s] that wheels were told to give by now;
    both in the base's axes.
    """

    def __init__(self, ledger: Ledger) -> None:
        """Register the inputs."""
        self._first = ledger.inputs().numel()
        for axis in QUATERNION:
            words = f"attitude of the base in the world frame (quaternion), {axis}"
            ledger.input(f"quat.base.{axis}", "1", words, float(axis == "w"))
        for name, unit, words in _GIVEN:
            ledger.vector_input(f"{name}.base", unit, f"{words}, in the world frame")
        words = "torque that reaction wheels are told to give the base, in its axes"
        ledger.vector_input("torque.wheels", "N*m", words)

    def _split(self, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """Velocity, spin, acceleration and spin's rate in the base's axes, and the wheels' torque; each (3,)."""
        own = u[self._first : self._first + 19]  # quaternion, four vectors, torque
        back = rotation_of(own[:4]).T
        v, w, a, alpha = (back @ own[k : k + 3] for k in (4, 7, 10, 13))
        return v, w, a, alpha, own[16:]

    def carriers(self, u: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Positions, rates and second rates (6,) of the joints that carry the base (`FloatingArm.whole`)."""
        v, w, a, alpha, _ = self._split(u)
        return ca.SX(CARRIERS, 1), ca.vertcat(v, w), ca.vertcat(a, alpha + carried_turning(w))

    def start(self, u: ca.SX) -> ca.SX:
        """The memory at the start."""
        return ca.vertcat(self._split(u)[1], ca.SX(3, 1))

    def later(self, memory: ca.SX, before: ca.SX, now: ca.SX, size: ca.SX) -> ca.SX:
        """The memory a step of ``size`` [s] later; torques are linear in time between."""
        return ca.vertcat(memory[:3], memory[3:] + size / 2 * (self._split(before)[4] + self._split(now)[4]))

    def signals(self, u: ca.SX, memory: ca.SX) -> dict[str, ca.SX]:
        """Signals of a law at the base."""
        _, w, a, alpha, _ = self._split(u)
        gained, impulse = w - memory[:3], memory[3:]
        return {"spin": w, "spin_rate": alpha, "acceleration": a, "spin_gained": gained, "impulse": impulse}

    def wheels(self, u: ca.SX, memory: ca.SX) -> ca.SX:
        """Moment (3,) [N·m] that wheels give the base: what they are told, and what they keep turning with it."""
        _, w, _, _, told = self._split(u)
        return told + ca.cross(w, memory[3:])
