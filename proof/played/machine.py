"""A machine along a motion: what its drives have to give, and what its sensors read."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from .laws import Slip, late
from .motions import STEP, Motion
from .residuals import rms
from .robots import Arm

Extra = Callable[["Drive"], NDArray]
"""Torque (n,) at one joint along a motion."""

SWING, ROUNDS, SETTLED = 5.0, 8, 0.01
"""Behind a spring a link moves with the torque below this [Hz]: its own swing, faster, is damped out. How often its
motion is worked out anew from the torque that bends it, and the share of the bend by which it then still may change."""


class TooSoft(ValueError):
    """A spring so soft that the link swings with the motion."""


@dataclass(frozen=True, eq=False)
class Drive:
    """What a law may hang on, of every joint: motion (n, J), rigid torque (n, J), direction (n, J)."""

    q: NDArray
    qd: NDArray
    qdd: NDArray
    load: NDArray
    direction: NDArray


@dataclass(frozen=True, eq=False)
class Machine:
    """An arm with its drives. Levels, viscous coefficients and rotor inertias (J,); ``extras`` by joint.

    ``bends`` gives, for a joint, how far the link lags behind the motor for a torque [rad]. Torque channels read
    ``gain`` (J,) times the torque and ``offset`` (J,) and ``drift`` (J,) a second more; positions come ``delay`` (J,)
    late [s]; ``given`` turns a joint's torque into what its current says.
    """

    arm: Arm
    slips: tuple[Slip, ...]
    level: NDArray
    viscous: NDArray
    rotor: NDArray
    extras: tuple[tuple[int, Extra], ...] = ()
    bends: tuple[tuple[int, Callable[[NDArray], NDArray]], ...] = ()
    gain: NDArray = field(default_factory=lambda: np.ones(1))
    offset: NDArray = field(default_factory=lambda: np.zeros(1))
    drift: NDArray = field(default_factory=lambda: np.zeros(1))
    delay: NDArray = field(default_factory=lambda: np.zeros(1))
    asked: tuple[tuple[int, Callable[[NDArray], NDArray]], ...] = ()

    def with_extra(self, k: int, extra: Extra) -> "Machine":
        """One more law at a joint."""
        return replace(self, extras=(*self.extras, (k, extra)))

    def drive(self, motion: Motion) -> Drive:
        """What the motors see."""
        q, qd, qdd = motion
        load = self.arm.dynamics().torque(*motion)
        link, low = q, butter(4, SWING, fs=1.0 / STEP, output="sos")
        for number in range(ROUNDS if self.bends else 0):
            before, link = link, q.copy()
            for k, bend in self.bends:
                link[:, k] -= np.asarray(sosfiltfilt(low, bend(load[:, k])))
            speed = np.gradient(link, STEP, axis=0)
            load = self.arm.dynamics().torque(link, speed, np.gradient(speed, STEP, axis=0))
            if number == ROUNDS - 1 and rms(link - before) > SETTLED * rms(link - q):
                raise TooSoft("a link swings with the motion")
        direction = np.stack([s.along(x) for s, x in zip(self.slips, q.T, strict=True)], axis=1)
        return Drive(q, qd, qdd, load, direction)

    def torque(self, motion: Motion) -> NDArray:
        """What the currents say (n, J), before disturbance and noise."""
        d = self.drive(motion)
        tau = d.load + self.rotor * d.qdd + self.level * d.direction + self.viscous * d.qd
        for k, extra in self.extras:
            tau[:, k] = tau[:, k] + extra(d)
        for k, more in self.asked:
            tau[:, k] = more(tau[:, k])
        return tau

    def read(self, tau: NDArray) -> NDArray:
        """What the torque channels read of a torque (n, J)."""
        time = np.arange(len(tau))[:, None] * STEP
        return self.gain * tau + self.offset + self.drift * time

    def positions(self, q: NDArray) -> NDArray:
        """What the encoders read of positions (n, J), before they round."""
        return np.stack([late(x, d) for x, d in zip(q.T, np.broadcast_to(self.delay, q.shape[1]), strict=True)], axis=1)


def beside_known(machine: Machine, d: Drive, k: int, extra: NDArray) -> float:
    """RMS of what the known friction and rotor inertia of a joint leave of a torque (n,) there, below 15 Hz or so."""
    every = max(1, round(0.01 / STEP))
    known = np.stack([d.direction[:, k], d.qd[:, k], d.qdd[:, k], np.ones(len(d.q))], axis=1)[::every, :3]
    x = extra[::every]
    return rms(x - known @ np.linalg.lstsq(known, x, rcond=None)[0])
